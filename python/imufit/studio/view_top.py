"""Top of the page: the logs, the verdict in a sentence, files that were brought, faults of the data, and the game."""

from __future__ import annotations

import html
import json
import secrets
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from nicegui import events, ui

from imufit.errors import InputError
from imufit.exporting import export
from imufit.figures import quantity
from imufit.printable import NAME, printable
from imufit.remedy import Option
from imufit.results import Diagnosis
from imufit.results.phrasing import capital
from imufit.studio import server
from imufit.studio.attribute import attribute
from imufit.studio.by_sensor import by_sensor
from imufit.studio.desk import BEING_READ, Desk
from imufit.studio.explained import Explained
from imufit.studio.icons import light_or_dark, link_with_words, with_words
from imufit.studio.log_file import LogFile, option_words, remedies
from imufit.studio.mystery import DEMO_SEED, DEMONSTRATION, LEVELS, NOTHING, SEEDS
from imufit.studio.names import effect_name, parameter_name, with_symbol
from imufit.studio.recipe import as_python, as_shell
from imufit.studio.reserved import FRAME, Reserved
from imufit.studio.saving import download_game, download_session, save_first
from imufit.studio.session import Made
from imufit.studio.session_file import LogsWantedError
from imufit.studio.view_verdict import show_verdict

MOST_BYTES: Final = 4 * 2**30
"""Largest file that the browser may send: 20 million rows of 14 columns take 2.2 GB."""
DROPS: Final = """
const elsewhere = event => !event.target.closest || !event.target.closest('.q-uploader');
document.addEventListener('dragover', event => { if (elsewhere(event)) event.preventDefault(); });
document.addEventListener('drop', event => {
  if (!elsewhere(event)) return;
  event.preventDefault();
  if (event.dataTransfer.files.length) getElement(UPLOADER).$refs.qRef.addFiles(event.dataTransfer.files);
});
"""
"""Script by which a file that is dropped anywhere on the page goes to the uploader of a number."""
EXAMPLE: Final = {"acc_x": "AccX[g]", "acc_y": "AccY[g]", "acc_z": "AccZ[g]"}
"""Mapping that shows how columns are named, where nothing is known of those in question."""
PART_JUDGED: Final = "rule"
"""Icon of an adequate model where a sensor was not judged, or a residual is left; and of a log that was not judged."""
WRONG_VALUE: Final = "a fixed value contradicts the log"
"""Verdict on a model with such a value, beside whose icon it stands: no effect can be judged there."""
ICONS: Final = {"adequate": "check_circle", "missing": "help", "ambiguous": "call_split", "unknown": "error"}


HEADER: Final = "imufit_calibration.h"
"""Name of the C header in the folder of downloads, as its guard calls it."""
OPTION: Final = """
<q-item-label header class="q-py-xs" v-if="(%s)[props.opt.value]">{{ (%s)[props.opt.value] }}</q-item-label>
<q-item v-bind="props.itemProps"><q-item-section>
  <q-item-label>{{ props.opt.label }}</q-item-label>
</q-item-section></q-item>
"""
"""Template of an entry of the list of answers: the first one of a group has the name of the group above it."""
NO_OPTION: Final = "<q-item><q-item-section>No effect has this in its name.</q-item-section></q-item>"
"""Template of the list of answers where none has the letters that were typed."""


class Head:
    """Buttons over the page.

    Parameters
    ----------
    desk : Desk
        The state that they change.
    sign : callable
        Lays the sign of what runs on another page.
    """

    def __init__(self, desk: Desk, sign: Callable[[], None]) -> None:
        self._desk = desk
        with ui.element("header").classes("studio-head"):
            ui.label("imufit").classes("studio-title")
            self._logs = ui.label("").classes("studio-log").props("data-mark=logs")
            sign()
            with_words("folder_open", "Open a log", lambda: _upload(desk)).props("data-mark=open")
            self._save = with_words("save", "Save the session", lambda: download_session(desk)).props("data-mark=save")
            with with_words("content_copy", "Copy the model", None).props("data-mark=copy") as self._copy, ui.menu():
                ui.menu_item("Copy as Python", lambda: self._show("Python")).props("data-mark=copy-python")
                ui.menu_item("Copy as shell", lambda: self._show("shell")).props("data-mark=copy-shell")
                ui.menu_item("Copy as C header", self._show_header).props("data-mark=copy-c")
            with with_words("psychology_alt", "Mystery log", None).props("data-mark=mystery"), ui.menu():
                for number, level in LEVELS.items():
                    if number == DEMONSTRATION:
                        continue
                    ui.menu_item(f"Level {number}: {level.title}", _player(desk, number)).props(
                        attribute("data-mark", f"level-{number}")
                    )
            for path, title in server.other_pages():
                link_with_words("sensors", title.removeprefix("imufit ").capitalize(), f".{path}").props(
                    attribute("data-mark", f"page-{path.removeprefix('/')}")
                )
            light_or_dark().props("data-mark=dark")

    def refresh(self) -> None:
        """Show the names of the logs."""
        desk = self._desk
        names = " + ".join(printable(file.name, NAME) for file in desk.files)
        self._logs.set_text(names or "no log")
        for button in (self._save, self._copy):
            button.set_enabled(desk.session is not None and desk.session.begun)

    def _made(self) -> Made | None:
        """Return the present model once it is estimated; the person is asked to wait until then."""
        session = self._desk.session
        made = None if session is None else session.made()
        if made is None:
            ui.notify("The model is being estimated: copy it once that is done.")
        return made

    def _show(self, form: str) -> None:
        """Show the text that makes the present model, and lay a copy in the clipboard."""
        desk = self._desk
        made = self._made()
        if made is None:
            return
        text = as_python(desk.files, made.way) if form == "Python" else as_shell(desk.files, made.way)
        first = ": save the log there first." if desk.game_log() is not None else "."
        with _copied(form, text, f"Copied. Run it in the folder of the log{first}"):
            if desk.game_log() is not None:
                ui.button("Save the log", on_click=lambda: download_game(desk)).props("outline").props(
                    "data-mark=save-log"
                )

    def _show_header(self) -> None:
        """Show the present model as a C header, as `imufit export --to c-header` writes it."""
        made = self._made()
        if made is None:
            return
        try:
            text = export(made.fit.model, "c-header")
        except InputError as error:
            ui.notify(printable(str(error)))
            return
        with _copied("C header", text, "Copied. Its functions correct the readings in a program of the device."):
            ui.button("Save the header", on_click=lambda: ui.download.content(text.encode(), HEADER)).props(
                "outline data-mark=save-header"
            )


@contextmanager
def _copied(form: str, text: str, words: str) -> Iterator[None]:
    """Show a text that was laid in the clipboard; buttons that are made within stand beneath the text."""
    with ui.dialog() as dialog, ui.card().style("max-width: 92vw"):
        ui.label(f"The present model as {form}").classes("studio-name")
        ui.label(words).classes("studio-muted")
        ui.label(text).classes("studio-copy").props("data-mark=copied")
        with ui.row():
            yield
            ui.button("Close", on_click=dialog.close).props("flat")
    dialog.on("hide", dialog.delete)
    dialog.open()
    ui.clipboard.write(text)


class Top:
    """Sentences over the regions.

    Parameters
    ----------
    desk : Desk
        The state that they show.
    """

    def __init__(self, desk: Desk) -> None:
        self._desk = desk
        self._state: tuple[object, ...] = ()
        with ui.element("div").classes(FRAME), ui.column().classes("w-full gap-0") as kept:
            self._column = ui.column().classes("w-full gap-2")
            # The line of the present work has its place under the sentences whether there is work or not.
            with (
                ui.element("div").classes("studio-work"),
                ui.row().classes("w-full items-start gap-2 no-wrap") as self._busy,
            ):
                ui.spinner(size="sm")
                self._work = ui.label("").classes("studio-muted")
        self._busy.props("data-mark=busy")
        self._busy.visible = False
        self._room = Reserved(kept)
        ui.timer(0.2, self._show_work)

    def _show_work(self) -> None:
        desk = self._desk
        self._busy.visible = bool(desk.busy)
        self._work.set_text(printable(desk.waiting_for))

    def refresh(self) -> None:
        """Show the verdict, what awaits a choice, problems and the game."""
        desk = self._desk
        session = desk.session
        diagnosis = desk.diagnosis
        verdict = None if desk.mystery is None else desk.mystery.verdict
        brought = tuple(item.file for item in desk.arrivals)
        answer = _named(desk) if desk.guessing else ""
        as_likely = {} if session is None else session.as_likely()
        state = (
            session is not None and session.refused,
            diagnosis,
            as_likely,
            desk.trouble,
            desk.in_shell,
            desk.typed,
            desk.mistyped,
            brought,
            desk.kept_session,
            desk.wanted,
            desk.joined,
            desk.mystery,
            verdict,
            answer,
            bool(desk.busy) and session is None,
            desk.replacing,
            desk.mystery is not None and desk.mystery.closed,
            session is not None and session.begun,
        )
        if state == self._state and self._state:
            return
        self._state = state
        self._room.about(self._subject())
        self._column.clear()
        with self._column:
            if desk.trouble:
                self._problem()
            if desk.wanted is not None:
                self._wanted(desk.wanted)
            if desk.kept_session is not None:
                self._session(desk.kept_session)
            if session is not None and session.refusal is not None:
                self._unjudged(session.refusal)
            if desk.arrivals:
                self._choice()
            # While another log is loaded, the answers on the present one would pass for answers on it.
            if desk.mystery is not None and not desk.mystery.closed and not desk.replacing:
                self._game(diagnosis is not None)
            if diagnosis is not None and not desk.guessing and not desk.replacing:
                self._verdict(diagnosis, as_likely)
            waiting = session is None and not desk.busy
            if (waiting or (session is not None and session.refused)) and not desk.arrivals and desk.wanted is None:
                self._welcome()

    def _subject(self) -> str:
        """Name the occasion of the sentences: a step of the model is the same one, another log or a question is not."""
        desk = self._desk
        game = desk.mystery
        over = game is not None and game.verdict is not None
        asked = (desk.trouble, desk.arrivals, desk.kept_session, desk.wanted, over, game is not None and game.closed)
        return f"{id(desk.session)}-{''.join(str(int(bool(each))) for each in asked)}"

    def _welcome(self) -> None:
        desk = self._desk
        if desk.session is not None:
            ui.label("Drop the reference of this log here, or another log.").classes("studio-sentence")
            _uploader(desk)
            return
        ui.label("Drop a log here, or two files that belong together.").classes("studio-sentence")
        ui.label(
            "A log is a table (CSV, Parquet, NPZ), or a file of a phone, a logger or an autopilot. It holds time, "
            "specific force and angular rate, and at best the attitude that a reference measured. The second file "
            "holds that reference where it was recorded apart."
        ).classes("studio-muted")
        _uploader(desk)
        ui.label("No log at hand? See the loop on a simulated log, or find the effect that one hides.").classes(
            "studio-muted"
        )
        with ui.row().classes("gap-2"):
            for number, level in LEVELS.items():
                words = level.title if number == DEMONSTRATION else f"Level {number}: {level.title}"
                action = _player(desk, number, DEMO_SEED if number == DEMONSTRATION else None)
                ui.button(words, on_click=action).props("outline size=12px").props(
                    attribute("data-mark", f"play-{number}")
                )

    def _session(self, path: Path) -> None:
        """Ask whether a session may take the place of the present one."""
        desk, name = self._desk, printable(path.name, NAME)
        ui.label(f"The session {name} takes the place of the present model, which is not saved.").classes(
            "studio-sentence"
        ).props("data-mark=unsaved")
        with ui.row():
            ui.button(f"Open {name}", on_click=lambda: desk.reopen(path)).props("outline data-mark=offer-session")
            ui.button("Cancel", on_click=desk.forget_arrivals).props("flat data-mark=session-cancel")

    def _wanted(self, wanted: LogsWantedError) -> None:
        """Ask for the logs of a session."""
        names = " and ".join(printable(Path(name).name, NAME) for name in wanted.names)
        ui.label(f"The session {printable(wanted.session.name, NAME)} wants {names}: drop the log here.").classes(
            "studio-sentence"
        ).props("data-mark=wanted")
        _uploader(self._desk)
        ui.button("Cancel", on_click=self._desk.forget_wanted).props("flat").props("data-mark=wanted-cancel")

    def _verdict(self, diagnosis: Diagnosis, as_likely: Mapping[str, Sequence[str]]) -> None:
        seen: set[str] = set()
        if diagnosis.named and not diagnosis.contradicted:
            with ui.element("div").classes("studio-headline").props("data-mark=missing"):
                for k, effect in enumerate(diagnosis.named):
                    ui.label(f"{'or' if k else 'Missing:'} {effect_name(effect)}").classes("font-semibold")
                    ui.label(printable(effect, NAME)).classes("studio-id")
        for held in diagnosis.contradicted:
            with ui.element("div").classes("studio-headline").props("data-mark=wrong-value"):
                ui.label(f"Wrong value: {parameter_name(held.effect, held.name)}").classes("font-semibold")
                ui.label(printable(held.key, NAME)).classes("studio-id")
        with ui.row().classes("w-full items-start gap-2 no-wrap"):
            word = WRONG_VALUE if diagnosis.contradicted else diagnosis.verdict
            icon = ui.icon(_icon_of(diagnosis), size="sm")
            icon.props(f'role=img aria-label="{word}" title="{word}"')
            Explained(diagnosis.sentence or diagnosis.verdict, seen).classes("studio-sentence").props(
                "data-mark=verdict"
            )
        advice = tuple(dict.fromkeys(item.advice for item in diagnosis.judged if item.advice))
        for words in filter(None, (diagnosis.experiment, *advice)):
            Explained(f"Next: {words}", seen).classes("studio-muted").props("data-mark=next")
        for effect, others in as_likely.items():
            names = " and ".join(f"{effect_name(name)} ({printable(name, NAME)})" for name in others)
            words = f"{capital(names)} explained the log as well as {effect_name(effect)} when this was added."
            Explained(f"{words} The log does not separate them.", seen).classes("studio-muted").props(
                "data-mark=as-likely"
            )
        for fault in diagnosis.data_faults:
            number = _number_of(self._desk, fault.file)
            with ui.element("div").classes("studio-error"):
                # The sentence on top holds the words of a fault that spoils the log.
                words = f"Data fault ({fault.fault})." if fault.spoils else str(fault)
                Explained(words, seen).classes("studio-muted").props("data-mark=fault")
                for option in remedies(fault.advice):
                    self._cure(option, number, "mend")
        for words in self._desk.joined:
            ui.label(printable(words)).classes("studio-muted").props("data-mark=joined")
        notes = [note for note in diagnosis.notes if note not in advice]
        if notes:
            words = f"{quantity.counted(len(notes), 'note')} on these data"
            with ui.expansion(words).classes("w-full").props("dense data-mark=notes"):
                for note in notes:
                    Explained(note, seen).classes("studio-muted")

    def _unjudged(self, refusal: InputError) -> None:
        """Say that nothing was judged, why, and what to record."""
        with ui.row().classes("w-full items-start gap-2 no-wrap"):
            ui.icon(PART_JUDGED, size="sm").props('role=img aria-label="not judged" title="not judged"')
            words = printable(f"Nothing was judged: {refusal.problem}.")
            ui.label(words).classes("studio-sentence").props("data-mark=unjudged")
        advice = refusal.advice
        if advice is None:
            return
        for option in remedies(advice):
            self._cure(option, 0, "cure")
        if advice.python == advice.shell:
            ui.label(printable(f"Next: {advice}")).classes("studio-muted").props("data-mark=next")
        else:
            with ui.expansion("To be recorded, or run in a shell").classes("w-full").props("dense data-mark=next"):
                ui.label(printable(advice.shell)).classes("studio-muted")

    def _cure(self, option: Option, number: int, mark: str) -> None:
        """Offer an option of a remedy."""

        async def apply() -> None:
            await self._desk.mend(option, number)

        ui.button(printable(option_words(option)), on_click=apply).props("dense outline size=12px").props(
            attribute("data-mark", mark)
        )

    def _problem(self) -> None:
        desk = self._desk
        with ui.element("div").classes("studio-error").props('role="alert"'):
            ui.label(printable(desk.trouble)).props("data-mark=trouble")
            if desk.session is not None and desk.troubled is not None and desk.troubled not in desk.files:
                shown = " and ".join(printable(file.name, NAME) for file in desk.files)
                ui.label(f"The page still shows {shown}.").classes("studio-muted")
            if desk.unmapped is not None:
                self._mapping(desk.unmapped)
            with ui.row():
                for option in desk.cures:
                    self._cure(option, 0, "cure")
                ui.button("Dismiss", on_click=desk.forget_trouble).props("dense flat size=12px")
            if desk.in_shell:
                with ui.expansion("In a shell").classes("w-full").props("dense data-mark=in-shell"):
                    ui.label(printable(desk.in_shell)).classes("studio-muted")

    def _mapping(self, file: LogFile) -> None:
        """Take names for the columns of a file."""

        async def read() -> None:
            await self._desk.remap(file, given.value)

        with ui.row().classes("w-full items-center"):
            given = ui.input(f"columns, such as {self._example()}", value=self._desk.typed).props("dense outlined")
            given.classes("grow").props("data-mark=mapping").on("keydown.enter", read)
            given.error = printable(self._desk.mistyped) or None
            ui.button("Read", on_click=read).props("dense outline")

    def _example(self) -> str:
        """Show the mapping of a sensor: of the one in question where that is known."""
        first = next((value for name, value in self._desk.cures if name == "mapping"), EXAMPLE)
        return printable(",".join(f"{target}={source}" for target, source in first.items()))

    def _choice(self) -> None:
        desk = self._desk
        for item in desk.arrivals:
            ui.label(f"{printable(item.file.name, NAME)}: {item.words}").classes("studio-muted").props(
                "data-mark=arrival"
            )
            for note in item.notes:
                ui.label(printable(note)).classes("studio-muted")
        offers = desk.offers
        if not offers:
            ui.label("This file holds a reference alone: drop the sensor's file as well.").classes("studio-sentence")
        if desk.unsaved:
            ui.label("Another log takes the place of the present model, which is not saved.").classes(
                "studio-sentence"
            ).props("data-mark=unsaved")
        for offer in offers:
            ui.button(printable(offer.words, 2 * NAME), on_click=lambda offer=offer: desk.open(offer.files)).props(
                "outline"
            ).props(attribute("data-mark", f"offer-{offer.way.value}"))
        if len(desk.arrivals) == 1 and not desk.arrivals[0].sensors and desk.unmapped is None:
            ui.label("If it holds readings, name their columns:").classes("studio-muted")
            self._mapping(desk.arrivals[0].file)
        ui.button("Cancel", on_click=desk.forget_arrivals).props("flat").props("data-mark=arrivals-cancel")

    def _game(self, judged: bool) -> None:
        desk = self._desk
        game = desk.mystery
        assert game is not None
        level = LEVELS[game.level]
        title = level.title if game.level == DEMONSTRATION else f"Mystery log, level {game.level}"
        # After the reveal nothing is left to be done here.
        words = title if game.verdict is not None else f"{title}: {level.words}"
        if game.level == DEMONSTRATION and game.verdict is None and _named(desk) != NOTHING:
            words = f"{title}: {ADDED}"
        ui.label(words).classes("studio-sentence").props("data-mark=game")
        if game.verdict is None:
            if not judged:
                # Later the line of the present work says what is under way.
                if desk.session is None or not desk.session.begun:
                    ui.label(BEING_READ).classes("studio-muted")
                return
            assert desk.session is not None
            if game.level == DEMONSTRATION:
                # Before an effect is added, Add is the one thing to press.
                if _named(desk) != NOTHING:
                    reveal = ui.button("Reveal the truth", on_click=lambda: desk.reveal(None))
                    reveal.props("outline").props("data-mark=reveal")
                return
            groups = by_sensor(desk.session.start.analysis.candidates)
            names = [name for effects in groups.values() for name in effects]
            choices = {NOTHING: "nothing is missing"} if level.nothing else {}
            choices |= {name: with_symbol(capital(effect_name(name)), name) for name in names}
            places = {name: k for k, name in enumerate(choices)}
            heads = html.escape(json.dumps({places[effects[0]]: part for part, effects in groups.items()}))
            with ui.row().classes("w-full items-center"):
                # Who added an effect has named it; another choice stays until the reveal.
                present = (_named(desk) or None) if game.answer is None else game.answer
                value = present if present in choices else None
                answer = ui.select(choices, value=value, label="Your answer: choose or type", with_input=True)
                answer.classes("studio-answer").props("dense outlined data-mark=answer")
                answer.add_slot("option", OPTION % (heads, heads))
                answer.add_slot("no-option", NO_OPTION)
                answer.on_value_change(lambda event: setattr(game, "answer", event.value))
                reveal = ui.button("Reveal", on_click=lambda: desk.reveal(answer.value)).props("data-mark=reveal")
                reveal.bind_enabled_from(answer, "value", lambda chosen: chosen is not None)
                ids = {words: effect for effect, words in choices.items()} | {name: name for name in names}

                def take(event: events.GenericEventArguments) -> None:
                    answer.value = ids.get(str(event.args).strip(), answer.value)
                    # The field keeps what was typed: the name of the effect takes its place, and filters nothing.
                    if answer.value is not None:
                        answer.run_method("updateInputValue", choices[answer.value], True)

                # Quasar's field forgets a name that was typed and not picked.
                for key in ("keydown.enter", "keydown.tab"):
                    answer.on(key, take, js_handler="(event) => emit(event.target.value)")
                why = ui.label("Choose an answer, then reveal the truth.").classes("studio-muted")
                why.props("data-mark=unanswered").bind_visibility_from(answer, "value", lambda chosen: chosen is None)
            return
        show_verdict(game.verdict)
        with ui.row():
            ui.button("Play again", on_click=_player(desk, game.level)).props("outline").props("data-mark=again")
            ui.button("Close", on_click=desk.close_game).props("flat").props("data-mark=game-close")


ADDED: Final = "The bars show what the effect took off the error. Reveal the truth, or add another effect."
"""Task of the demonstration once an effect is added."""


def _icon_of(diagnosis: Diagnosis) -> str:
    if diagnosis.contradicted:
        return ICONS["unknown"]
    # The tick is for a whole model: every sensor was judged, and no residual stands above its noise.
    return ICONS[diagnosis.verdict] if diagnosis.whole or diagnosis.verdict != "adequate" else PART_JUDGED


def _named(desk: Desk) -> str:
    """Return the effect that the present model names: the first one added."""
    effects = () if desk.session is None else desk.session.stack.model.effects
    return effects[0] if effects else NOTHING


def _number_of(desk: Desk, name: str | None) -> int:
    """Return the number of the log with a name that a fault gives; the first where there is one log."""
    names = [file.path.name for file in desk.files]
    return names.index(name) if name in names else 0


def _player(desk: Desk, level: int, seed: int | None = None) -> Callable[[], Awaitable[None]]:
    """Return what begins a game; a person is asked first where a model is not saved."""
    return save_first(desk, lambda: desk.play(level, secrets.randbelow(SEEDS) if seed is None else seed))


def _upload(desk: Desk) -> None:
    """Ask for files."""
    with ui.dialog() as dialog, ui.card():
        ui.label("Drop a log, or two files that belong together. A saved session opens with its log.").classes(
            "studio-muted"
        )
        _uploader(desk, dialog.close)
        ui.button("Cancel", on_click=dialog.close).props("flat")
    dialog.on("hide", dialog.delete)
    dialog.open()


def takes_drops(desk: Desk) -> None:
    """Let the whole page take files that are dropped on it.

    Parameters
    ----------
    desk : Desk
        Where the files go.
    """
    with ui.element("div").classes("hidden"):
        uploader = _uploader(desk).props("data-mark=dropped")
    ui.run_javascript(DROPS.replace("UPLOADER", str(uploader.id)))


def _uploader(desk: Desk, done: Callable[[], object] | None = None) -> ui.upload:
    async def take(event: events.MultiUploadEventArguments) -> None:
        files = []
        folder = desk.new_folder()
        for sent in event.files:
            # The browser decides the name: only its last part counts, and it names a file.
            name = Path(sent.name.replace("\\", "/")).name.lstrip(".") or "log"
            path = folder / name
            await sent.save(path)
            files.append(LogFile(path, name))
        if done is not None:
            done()
        await desk.bring(files)

    box = ui.upload(
        label="Drop files or press +", multiple=True, auto_upload=True, on_multi_upload=take, max_total_size=MOST_BYTES
    )
    return box.props("flat bordered").props("data-mark=upload")
