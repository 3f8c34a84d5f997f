"""Figures of the studio: what the bars of the fall of the error say."""

from imufit.studio import charts


def test_steps_that_were_undone_stand_in_the_legend():
    names = ["ideal sensor", "+ acc.bias", "acc.bias.x fixed"]
    ratios, expected = [15.8, 15.7, 15.7], [None, 15.7, None]
    there = charts.fall(names, ratios, expected, 2)
    undone = charts.fall(names, ratios, expected, 1)
    assert "undone" not in [trace["name"] for trace in there["data"] if "name" in trace]
    assert "undone" in [trace["name"] for trace in undone["data"] if "name" in trace]
    over = [next(trace["text"] for trace in made["data"] if "text" in trace) for made in (there, undone)]
    assert over == [["15.8", "15.7", "now<br>15.7"], ["15.8", "now<br>15.7", "15.7"]]
    assert undone["data"][0]["marker"]["opacity"] == [1.0, 1.0, charts.UNDONE]


def test_a_long_step_takes_no_room_from_the_bars():
    name = "influence of temperature_of_the_left_motor on the accelerometer x fixed"
    figure = charts.fall(["ideal sensor", name], [2.0, 1.0], [None, None], 1, best=(f"+ {name}", 0.9))
    assert figure["layout"]["xaxis"]["ticktext"] == ["0", "1", charts.NEXT]
    assert figure["data"][0]["customdata"][1] == name
