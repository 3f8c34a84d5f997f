"use strict";
/* Draws the traces with Bokeh where the browser allows it; without it the still figures stay. */
(() => {
  const held = (id) => document.getElementById(id);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const unpacked = async (id) => {
    const stream = new Blob([bytes(held(id).textContent.trim())]).stream();
    return new Response(stream.pipeThrough(new DecompressionStream("gzip"))).text();
  };
  const floats = (text) => text && Array.from(new Float32Array(bytes(text).buffer));
  const steps = (part) => part && Array.from(new Int16Array(bytes(part.values).buffer), (value) => value === -32768 ? NaN : value * part.step);
  const times = (text) => Array.from(new Float64Array(bytes(text).buffer));

  const colours = (text, palette) => {
    const root = getComputedStyle(document.documentElement);
    let out = text;
    for (const [colour, name] of Object.entries(palette)) {
      out = out.replaceAll(new RegExp(colour, "gi"), root.getPropertyValue(name).trim());
    }
    return out;
  };

  const start = async () => {
    const script = document.createElement("script");
    script.textContent = await unpacked("chart-library");
    document.head.append(script);
    const data = JSON.parse(await unpacked("chart-data"));
    const channel = held("chart-channel");
    const switches = [...document.querySelectorAll("#chart-effects input")];
    const target = held("chart-picture");
    let shown = null;

    const model = (name) => shown.model.document.get_model_by_name(name);
    const fill = () => {
      const one = data.channels[channel.value];
      const measured = floats(one.measured);
      const residual = floats(one.residual);
      for (const each of switches) {
        const part = steps(one.parts[each.value]);
        each.parentElement.hidden = !part;
        if (part && !each.checked) part.forEach((value, row) => { residual[row] += value; });
      }
      const samples = { t: times(one.t), measured, residual, predicted: measured.map((value, row) => value - residual[row]) };
      if (one.before) samples.before = floats(one.before);
      model("samples").data = samples;
      model("floor").setv({ bottom: -one.floor, top: one.floor });
      model("readings").axis_label = `${channel.value}, ${one.unit}`;
      model("residuals").axis_label = `residual, ${one.unit}`;
      const seen = residual.filter(Number.isFinite);
      const square = seen.reduce((sum, value) => sum + value * value, 0) / Math.max(seen.length, 1);
      target.dataset.rms = String(Math.sqrt(square));
    };
    const draw = async () => {
      target.replaceChildren();
      const views = await Bokeh.embed.embed_item(JSON.parse(colours(JSON.stringify(data.item), data.palette)), target);
      shown = [...views][0] ?? views.roots?.[0];
      // A finger scrolls the page until its owner chooses the zoom.
      if (matchMedia("(pointer: coarse)").matches) {
        for (const each of shown.model.references()) if (each.type === "BoxZoomTool") each.active = false;
      }
      fill();
    };

    held("chart").hidden = false;
    await draw();
    held("traces").classList.add("live");
    channel.addEventListener("change", fill);
    switches.forEach((each) => each.addEventListener("change", fill));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
    target.dataset.ready = "yes";
  };

  const failed = (error) => {
    held("chart").hidden = true;
    held("traces").classList.remove("live");
    console.warn(`The chart cannot be drawn here: ${error}`);
  };
  if (held("chart") && "DecompressionStream" in window) start().catch(failed);
})();
