"use strict";
/* Turns the figures in space by mouse, finger or arrow keys; the still figure stays until the first turn. */
for (const held of document.querySelectorAll(".space")) {
  const scene = JSON.parse(held.querySelector("script").textContent);
  const svg = held.querySelector("svg");
  const [, , width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
  const points = [...scene.lines.flatMap((line) => line.at), ...scene.words.map((word) => word.at)];
  const scale = 0.42 * Math.min(width, height) / Math.max(...points.map((at) => Math.hypot(...at)));
  let [elevation, azimuth] = scene.view;

  const made = (name, attributes, style, text = "") => {
    const element = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
    Object.assign(element.style, style);
    element.textContent = text;
    return element;
  };
  const draw = () => {
    const [a, e] = [azimuth, elevation];
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    const along = (at, axis) => at.reduce((sum, value, k) => sum + value * axis[k], 0);
    const seen = (at) => [width / 2 + scale * along(at, right), height / 2 - scale * along(at, up)];
    const parts = scene.lines.flatMap((line) => {
      const places = line.at.map(seen);
      const ends = places.map((each) => each.map((value) => value.toFixed(1)).join(","));
      const path = { stroke: line.colour, strokeWidth: line.width, strokeDasharray: line.dashed ? "4 3" : "none", fill: "none" };
      const dots = line.dot ? places.map(([cx, cy]) => made("circle", { cx, cy, r: line.dot / 2 }, { fill: line.colour })) : [];
      return line.width ? [made("polyline", { points: ends.join(" ") }, path), ...dots] : dots;
    });
    const words = scene.words.flatMap((word) => word.text.split("\n").map((text, row) => {
      const [x, y] = seen(word.at);
      return made("text", { x, y: y + 11 * row, "text-anchor": "middle" }, { fill: word.colour, fontSize: "9px" }, text);
    }));
    svg.replaceChildren(...parts, ...words);
    held.dataset.azimuth = azimuth.toFixed(3);
  };
  const turn = (sideways, upwards) => {
    azimuth -= sideways;
    elevation = Math.min(Math.max(elevation + upwards, -Math.PI / 2), Math.PI / 2);
    draw();
  };

  held.addEventListener("pointerdown", (event) => { held.setPointerCapture(event.pointerId); });
  held.addEventListener("pointermove", (event) => {
    if (held.hasPointerCapture(event.pointerId)) turn(0.01 * event.movementX, 0.01 * event.movementY);
  });
  held.addEventListener("keydown", (event) => {
    const way = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (way) { event.preventDefault(); turn(...way); }
  });
  held.classList.add("turns");
}
