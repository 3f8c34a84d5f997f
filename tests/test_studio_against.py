"""The list that a residual stands against, and the channel on which the figure opens."""

import pytest
from imufit.lab.simulate import simulate
from imufit.results.comparison import OFFSET
from imufit.results.sentences import leading
from imufit.studio.against import SMALL, UNKNOWN, against, opens_on
from imufit.studio.log_file import LogFile
from imufit.studio.mystery import DEMO_SEED, DEMONSTRATION, Mystery
from imufit.studio.session import Session, worst_channel


def judged(level, seed, folder):
    """A session on the log of a game."""
    game = Mystery.hidden(level, seed, folder)
    session = Session([LogFile(game.log, game.log.name).open()])
    session.begin()
    return session


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    """A gyroscope that is late: its residual follows the change of the rate, which is a column of no log."""
    return judged(3, 1, tmp_path_factory.mktemp("late"))


def test_a_cause_that_explains_the_residual_leads_the_list(late):
    found = late.compare()
    channel = worst_channel(found)
    shares = late.weigh_causes()[channel]
    listed = against(found, channel, late.causes(channel), shares)
    assert next(iter(listed.values())) == "change of the angular rate (domega/dt) (100 %)"
    # Nothing is left out, and the covariates stand among the causes.
    covariates = {panel.covariate: panel.share for panel in found.panels if panel.channel == channel}
    known = {**{cause: shares[cause] for cause in late.causes(channel)}, **covariates}
    assert set(listed) == set(known)
    order = [known[name] for name in listed]
    assert order == sorted(order, reverse=True)
    assert any(words.endswith(f"({SMALL})") for words in listed.values())


def test_the_figure_opens_on_a_cause_where_no_covariate_shows_half_as_much(late):
    found = late.compare()
    channel = worst_channel(found)
    shares = late.weigh_causes()[channel]
    best = max(item.share for item in found.panels if item.channel == channel)
    assert shares["domega/dt"] > 2.0 * best
    assert opens_on(found, channel, shares) == "domega/dt"
    # A covariate stands in the figure until the causes are weighed, and where it shows nearly as much.
    covariate = max((item for item in found.panels if item.channel == channel), key=lambda item: item.share).covariate
    assert opens_on(found, channel, None) == covariate
    assert opens_on(found, channel, {"domega/dt": 1.5 * best}) == covariate


def test_an_offset_depends_on_nothing_and_opens_on_time(tmp_path):
    """A cause that hardly varies must not pass for an offset: the size of the speed, for instance."""
    log = simulate("handheld", {"acc.bias": {"x": 0.0, "y": 0.0, "z": -0.08}}, 3, duration=60.0, rate=50.0).to_log()
    session = Session([log])
    session.begin()
    found, channel = session.compare(), "acc_z"
    shares = session.weigh_causes()[channel]
    assert max(shares.values()) < 0.1
    assert opens_on(found, channel, shares) is None
    offset = next(item for item in found.where if (item.channel, item.covariate) == (channel, OFFSET))
    assert offset.share > 0.9


def test_a_cause_without_a_share_yet_says_so(late):
    found = late.compare()
    channel = worst_channel(found)
    assert against(found, channel, late.causes(channel), None)["domega/dt"].endswith(f"({UNKNOWN})")


def test_a_channel_at_its_floor_has_no_shares(late):
    late.add("gyr.delay")
    found = late.compare()
    assert late.weigh_causes() == {}
    listed = against(found, "gyr_y", late.causes("gyr_y"), {})
    assert "domega/dt" in listed
    assert not any("%" in words for words in listed.values())


def test_the_figure_opens_on_the_channel_of_the_value_that_the_sentence_states(tmp_path):
    session = judged(DEMONSTRATION, DEMO_SEED, tmp_path)
    best = session.diagnose().best_candidate
    clearest = leading(best.parameters)
    assert clearest.key == "acc.scale.y"
    # The channel that stands highest is another one.
    assert worst_channel(session.compare()) == "acc_x"
    assert session.channel_of(clearest) == "acc_y"
    assert {item.name: session.channel_of(item) for item in best.parameters} == {
        "x": "acc_x",
        "y": "acc_y",
        "z": "acc_z",
    }
