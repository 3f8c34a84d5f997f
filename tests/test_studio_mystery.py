"""The game: the evidence finds what can be found, and the reveal says how sure one could have been."""

import pytest
from imufit.errors import InputError
from imufit.figures import quantity
from imufit.lab.simulate import hidden, unseal
from imufit.model.catalogue import card_of, find_effect
from imufit.studio.log_file import LogFile
from imufit.studio.mystery import ALIKE, DEMO_SEED, DEMONSTRATION, DURATION, LEVELS, NOTHING, RATE, Mystery
from imufit.studio.session import Session


def played(level, seed, folder):
    """A game, and the evidence on its log."""
    game = Mystery.hidden(level, seed, folder)
    session = Session([LogFile(game.log, game.log.name).open()])
    session.begin()
    return game, session.diagnose()


def test_a_large_effect_is_named_by_the_evidence(tmp_path):
    game, first = played(1, 3, tmp_path)
    (truth,) = unseal(game.log).effects
    assert first.best == truth
    right = game.reveal(truth, first)
    assert right.right
    assert right.truth == (truth,)
    said = f"{card_of(find_effect(truth)).name} ({truth})"
    assert right.sentences[0] == f"Right: {said} was hidden, and you named {said}."
    name, value = next(iter(unseal(game.log).effects[truth].items()))
    unit = next(unit for key, unit, _ in find_effect(truth).parameters if key == name)
    # One line on the probability, and the hidden values beside those of the evidence until the effect is in the model.
    assert right.sentences[1:] == (f"You could have been sure: the evidence gives {said} a probability of > 99.9 %.",)
    assert (right.values[0].key, right.values[0].hidden) == (f"{truth}.{name}", quantity.quantity(value, unit))
    assert right.values[0].fitted.endswith("(to first order)")
    fitted = next(item for item in first.candidates if item.effect == truth).parameters
    assert [row.fitted for row in game.reveal(truth, first, fitted).values] == [item.shown for item in fitted]
    assert right.lesson == LEVELS[1].lesson
    wrong = game.reveal(NOTHING, first)
    assert not wrong.right
    assert wrong.sentences[0].startswith("Not right")


def test_the_demonstration_states_the_truth_and_judges_no_answer(tmp_path):
    game, first = played(DEMONSTRATION, DEMO_SEED, tmp_path)
    (truth,) = unseal(game.log).effects
    assert game.reveal(None, first).sentences[0].endswith(f"({truth}) was hidden.")


def test_level_1_hides_no_effect_that_another_one_resembles(tmp_path):
    """The log of this number alone would hide a late reference, which looks like a late gyroscope."""
    assert list(hidden("handheld", 1, size="large", duration=DURATION, rate=RATE)[1].effects) == ["ref.delay"]
    game, first = played(1, 1, tmp_path)
    assert list(unseal(game.log).effects) == [first.best]
    found = first.best_candidate
    assert all(abs(rival.correlation) < ALIKE for rival in found.confounded_with)


def test_nothing_may_be_hidden(tmp_path):
    game, first = played(2, 0, tmp_path)
    assert not unseal(game.log).effects
    right = game.reveal(NOTHING, first)
    assert right.right
    assert right.lesson == LEVELS[2].absence
    false_alarm = game.reveal("acc.bias", first)
    assert not false_alarm.right
    assert "You could not have named an effect" in false_alarm.sentences[-1]
    assert false_alarm.values == ()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_rival_is_allowed_where_the_log_does_not_separate_it(tmp_path, seed):
    game, first = played(3, seed, tmp_path)
    (truth,) = unseal(game.log).effects
    assert first.verdict == "ambiguous"
    alike = [first.best, *first.ambiguous_with]
    assert truth in alike
    rival = next(effect for effect in alike if effect != truth)
    answer = game.reveal(rival, first)
    assert not answer.right
    assert answer.sentences[0].startswith("Accepted")
    assert "You could not have been sure" in answer.sentences[-1]


def test_the_same_number_is_the_same_game(tmp_path):
    first, second = (Mystery.hidden(1, 8, tmp_path / name) for name in ("a", "b") if (tmp_path / name).mkdir() is None)
    assert unseal(first.log).effects == unseal(second.log).effects
    with pytest.raises(InputError, match="level 4 is unknown"):
        Mystery.hidden(4, 1, tmp_path)
