"""The state that all pages of one server share, and the work that runs beside them in a thread."""

from __future__ import annotations

import logging
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final, TypeVar, cast

from nicegui import Event, app, run

from imufit.errors import InputError
from imufit.log import Reading
from imufit.remedy import Option, Remedy
from imufit.results import Diagnosis
from imufit.results.phrasing import capital
from imufit.studio.log_file import Arrival, LogFile, Offer, Way, arrived, join_of, offers, remedies
from imufit.studio.mystery import DEMONSTRATION, Mystery
from imufit.studio.names import estimating, model_name
from imufit.studio.session import Made, Session
from imufit.studio.session_file import Kept, LogsWantedError, as_toml, read_session
from imufit.studio.stack import Stack, Step
from imufit.studio.traces import ModelTraces, Traces

Answer = TypeVar("Answer")

BEING_READ: Final = "The log is being read."
"""Sentence in a region whose content comes with the evidence."""
SESSION_ENDING: Final = ".toml"
"""Ending of the file of a session."""


@dataclass(frozen=True)
class Piece:
    """A piece of work.

    Attributes
    ----------
    words : str
        The work in words.
    work : callable
        The work.
    file : LogFile or None
        The file that a problem of it concerns.
    judged : Stack or None
        The model that is asked about, where another model needs another answer.
    """

    words: str
    work: Callable[[], object]
    file: LogFile | None = None
    judged: Stack | None = None


@dataclass(frozen=True)
class Shown:
    """A session, and what is shown of it.

    Attributes
    ----------
    session : Session or None
        The session.
    files : tuple of LogFile
        Its logs.
    mystery : Mystery or None
        The game that is played on them.
    joined : tuple of str
        How the references were joined to them.
    traces : Traces or None
        Columns of the log over time.
    models : dict of Stack to ModelTraces
        Residuals over time.
    """

    session: Session | None
    files: tuple[LogFile, ...]
    mystery: Mystery | None = None
    joined: tuple[str, ...] = ()
    traces: Traces | None = None
    models: dict[Stack, ModelTraces] = field(default_factory=dict)


class _FailedError(Exception):
    """Work that ended with a problem, which has been noted.

    Parameters
    ----------
    problem : InputError or None
        The fault of the person's input, where it is the reason.
    """

    def __init__(self, problem: InputError | None = None) -> None:
        super().__init__()
        self.problem = problem


class _SupersededError(Exception):
    """Work whose answer is not wanted any more: another log or another model is shown, or the server ends."""


class Desk:
    """The state of the studio: a session on its logs, files that were brought, a game.

    Attributes
    ----------
    session : Session or None
        The session; None before a log is there.
    files : tuple of LogFile
        Its logs.
    arrivals : list of Arrival
        Files that were brought and await a choice.
    kept_session : Path or None
        The file of a session that was brought and awaits a choice, since the present model is not saved.
    wanted : LogsWantedError or None
        The session that waits for its logs.
    mystery : Mystery or None
        The game, while one is played.
    replacing : bool
        Whether another log is being loaded, which takes the place of the one that is shown.
    joined : tuple of str
        How the references of the logs were joined to them.
    channel, covariate : str or None
        The panel that the person chose; None is the worst one.
    traces : Traces or None
        Columns of the log over time.
    models : dict of Stack to ModelTraces
        Residuals of the ideal sensor and of the present model over time.
    busy : str
        The present work, in words; empty where there is none.
    share : float or None
        Share of the rows that the present pass has read; None between two passes.
    passes : int
        How many passes over all rows the present work has made; how many a search will make is not known before.
    trouble : str
        The last problem; empty where there is none.
    in_shell : str
        The last problem's remedy in the words of the command line, where it names an option.
    troubled : LogFile or None
        The file that gave the last problem.
    cures : list of Option
        Options of reading that the problem's remedy names.
    typed : str
        The mapping that a person typed and that does not read the file; empty where there is none.
    mistyped : str
        The problem with it.
    changed : Event
        Fires when something of this is new.
    """

    def __init__(self) -> None:
        self.session: Session | None = None
        self.files: tuple[LogFile, ...] = ()
        self.arrivals: list[Arrival] = []
        self.kept_session: Path | None = None
        self.wanted: LogsWantedError | None = None
        self.mystery: Mystery | None = None
        self.replacing = False
        self.joined: tuple[str, ...] = ()
        self.channel: str | None = None
        self.covariate: str | None = None
        self.traces: Traces | None = None
        self.models: dict[Stack, ModelTraces] = {}
        self.busy = ""
        self.share: float | None = None
        self.passes = 0
        self.trouble = ""
        self.in_shell = ""
        self.cures: list[Option] = []
        self.typed = self.mistyped = ""
        self.changed: Event[[]] = Event()
        self._folder = tempfile.TemporaryDirectory(prefix="imufit-")
        self._working = False
        self._closed = False
        self._worker = threading.local()
        self.troubled: LogFile | None = None
        self._before: Shown | None = None
        self._kept = ""

    def new_folder(self) -> Path:
        """Make a folder for files that come together; it goes with the server.

        An open log stays as it is where another file of its name is brought later.
        """
        return Path(tempfile.mkdtemp(dir=self._folder.name))

    def _folders(self) -> list[Path]:
        """List the folders of the files that the browser sent, the latest first."""
        folders = [path for path in Path(self._folder.name).iterdir() if path.is_dir()]
        return sorted(folders, key=lambda path: -path.stat().st_mtime_ns)

    @property
    def waiting_for(self) -> str:
        """The present work in a sentence, and how far it is; empty where there is none."""
        if not self.busy:
            return ""
        far = []
        if self.passes:
            far.append(f"all rows were read {'once' if self.passes == 1 else f'{self.passes} times'}")
        if self.share is not None:
            far.append(f"{100.0 * self.share:.0f} % {'again' if self.passes else 'of the rows are read'}")
        return f"{capital(self.busy)}{': ' if far else ''}{', and '.join(far)}."

    @property
    def guessing(self) -> bool:
        """Whether a game is on whose truth is not revealed: the evidence's names stay hidden."""
        game = self.mystery
        return game is not None and game.verdict is None and game.level != DEMONSTRATION

    @property
    def diagnosis(self) -> Diagnosis | None:
        """Diagnosis on top of the present model; None while it is not there."""
        made = self._made
        return None if made is None else made.diagnosis

    @property
    def _made(self) -> Made | None:
        """Return what was worked out of the present model; None while that is not there."""
        session = self.session
        return None if session is None or not session.begun else session.made()

    def reveal(self, answer: str | None) -> None:
        """End the game with an answer.

        Parameters
        ----------
        answer : str or None
            Id of an effect; empty answers that nothing is missing, and None where no answer was asked for.
        """
        session, game = self.session, self.mystery
        first = None if session is None else session.made(Stack())
        if session is not None and game is not None and first is not None and first.diagnosis is not None:
            numbers = session.numbers()
            game.reveal(answer, first.diagnosis, () if numbers is None else numbers.parameters)
            self.changed.emit()

    def close_game(self) -> None:
        """Put the end of the game away; its log stays open."""
        if self.mystery is not None:
            self.mystery.closed = True
            self.changed.emit()

    @property
    def offers(self) -> list[Offer]:
        """Uses of the files that were brought."""
        found = offers(self.arrivals)
        if len(self.arrivals) != 1:
            return found
        brought = self.arrivals[0]
        unjudged = self.session is not None and self.session.refused
        joins = brought.reference and (unjudged or not brought.sensors)
        return [join_of(file, brought.file) for file in self.files if joins] + found

    @property
    def unmapped(self) -> LogFile | None:
        """The file that cannot be read until its columns are named; None where the last problem is another one."""
        return self.troubled if self.in_shell else None

    @property
    def unsaved(self) -> bool:
        """Whether the way to the present model would be lost with its session."""
        session = self.session
        return session is not None and len(session.steps) > 1 and self.saved() != self._kept

    # --- work

    def progress(self, done: int, total: int, label: str) -> None:
        """Note how far the work is, and end work that is superseded; pages look at the share a few times a second.

        Rows are read for figures as well, in threads that are none of the work's: they have nothing to note.
        """
        superseded = getattr(self._worker, "superseded", None)
        if superseded is None:
            return
        if superseded():
            raise _SupersededError
        if (done, total) == (0, 1):
            self.busy, self.share, self.passes = label, None, 0
        elif done < total:
            self.share = done / total
        else:
            self.share = None
            self.passes += 1

    def close(self) -> None:
        """End the work at its next step: the server ends."""
        self._closed = True

    async def _tried(self, words: str, work: Callable[[], Answer], file: LogFile | None = None) -> Answer | None:
        """Run work in a thread; a problem is noted and gives None."""
        try:
            return await self._in_thread(words, work, file)
        except (_FailedError, _SupersededError):
            return None

    async def _loaded(self, words: str, work: Callable[[], Answer], file: LogFile | None = None) -> Answer | None:
        """Run work that makes another log: meanwhile the answers on the present one are not shown."""
        self.replacing = True
        try:
            return await self._tried(words, work, file)
        finally:
            self.replacing = False
            self.changed.emit()

    async def _in_thread(
        self,
        words: str,
        work: Callable[[], Answer],
        file: LogFile | None = None,
        superseded: Callable[[], bool] = lambda: False,
    ) -> Answer:
        """Run work in a thread; a problem is noted, and `_FailedError` raised; work that is superseded ends early."""

        def unwanted() -> bool:
            return self._closed or superseded()

        def watched() -> Answer:
            self._worker.superseded = unwanted
            try:
                return work()
            except Exception as error:
                # Work may stumble over what was put away meanwhile.
                if unwanted():
                    raise _SupersededError from error
                raise
            finally:
                del self._worker.superseded

        self.busy, self.share, self.passes = words, None, 0
        self.changed.emit()
        try:
            found = await run.io_bound(watched)
            if app.is_stopping or self._closed:
                # It gives None where the server ends meanwhile, when no page is left.
                self.close()
                raise _SupersededError
            return cast(Answer, found)
        except InputError as error:
            advice = error.advice
            if file is not None and isinstance(advice, Remedy) and advice.python != advice.shell:
                # Options of a shell: the page has buttons and a field in their place.
                self._note(error.statement, remedies(advice), file)
                self.in_shell = advice.shell
            else:
                self._note(str(error), remedies(advice), file)
            raise _FailedError(error) from error
        except (OSError, MemoryError) as error:
            self._note(f"{type(error).__name__}: {error}", [], file)
            raise _FailedError from error
        except _SupersededError:
            raise
        except Exception as error:
            # A fault of the program must not end the page: the person may save the session.
            logging.getLogger(__name__).exception("the studio's work failed")
            self._note(f"internal error: {type(error).__name__}: {error}", [], file)
            raise _FailedError from error
        finally:
            self.busy, self.share = "", None
            self.changed.emit()

    def _note(self, problem: str, cures: list[Option], file: LogFile | None) -> None:
        self._no_trouble()
        self.trouble, self.cures, self.troubled = problem, cures if file is not None else [], file

    def _no_trouble(self) -> None:
        self.trouble, self.in_shell, self.cures, self.troubled = "", "", [], None
        self.typed = self.mistyped = ""

    def forget_trouble(self) -> None:
        """Put the last problem away."""
        self._no_trouble()
        self.changed.emit()

    def forget_arrivals(self) -> None:
        """Put away the files that await a choice: the present session stays."""
        self.arrivals, self.kept_session = [], None
        self.typed = self.mistyped = ""
        self.changed.emit()

    def forget_wanted(self) -> None:
        """Leave the session whose logs are not there."""
        self.wanted = None
        self.changed.emit()

    async def attempt(self, action: Callable[[], None]) -> None:
        """Change the session, then bring fit, diagnosis and comparison up to date.

        Parameters
        ----------
        action : callable
            The change; a quick one.
        """
        self._no_trouble()
        before = self._made
        try:
            action()
        except InputError as error:
            self._note(str(error), [], None)
        self.changed.emit()
        await self.update()
        self._leave_healthy(before)

    def _leave_healthy(self, before: Made | None) -> None:
        """Give up the chosen panel if a step changed the error elsewhere: the fall would not be seen in it."""
        shown = [made.comparison.failing for made in (before, self._made) if made is not None and made.comparison]
        if self.channel is not None and any(shown) and all(self.channel not in failing for failing in shown):
            self.channel = self.covariate = None
            self.changed.emit()

    async def update(self) -> None:
        """Bring fit, diagnosis and comparison of the present model up to date; further changes join the work."""
        if self._working:
            return
        self._working = True
        try:
            while (piece := next(self._pending(), None)) is not None:
                session = self.session
                superseded = partial(self._superseded, session, piece)
                try:
                    await self._in_thread(piece.words, piece.work, piece.file, superseded)
                except _SupersededError:
                    if self._closed:
                        return
                except _FailedError as failed:
                    if session is self.session:
                        self._give_up(failed.problem)
                        return
        finally:
            self._working = False

    def _superseded(self, session: Session | None, piece: Piece) -> bool:
        """Return whether an answer is not wanted any more: other logs are open, or another model is asked about."""
        if session is None or session is not self.session:
            return True
        return piece.judged is not None and session.stack.model != piece.judged.model

    def _give_up(self, problem: InputError | None) -> None:
        """Return to the step before one whose model cannot be fitted, or to the session before one without rows.

        The rows of a log without evidence stay, to be looked at, with the reason why nothing is judged.
        """
        session = self.session
        if session is None or session.made() is not None:
            return
        if session.begun:
            session.give_up()
        elif problem is not None and self.traces is not None and self.traces.built:
            session.refusal = problem
            self._no_trouble()
            self._forget_before()
        else:
            self._show(self._before or Shown(None, ()))
            self._before = None
        self.changed.emit()

    def _pending_first(self, session: Session) -> Iterator[Piece]:
        """List the pieces of work before anything can be fitted: a person sees the rows while the evidence is taken."""
        if self.traces is None or not self.traces.built or self.traces.log is not session.logs[session.shown]:
            yield Piece("reading the rows, to draw them over time", self._drawn_rows, self.files[0])
        if not session.begun and not session.refused:
            names = " and ".join(file.name for file in self.files)
            yield Piece(
                f"weighing every effect on {names}, for the verdict and the candidates",
                partial(session.begin, self.progress),
                self.files[0],
            )
        else:
            self._forget_before()

    def _pending(self) -> Iterator[Piece]:
        """List the pieces of work that are to be done for the present model, in order."""
        session = self.session
        if session is None:
            return
        yield from self._pending_first(session)
        if not session.begun:
            return
        stack = session.stack
        made = session.made(stack)
        words = model_name(stack.model.effects)
        # Earlier ones first: a session that was reopened goes the same way again.
        yield from self._unfitted(session, session.steps[: session.position + 1])
        if made is None:
            return
        if made.comparison is None:
            yield Piece(
                f"computing the residuals of {words}, for the figures",
                partial(session.compare, stack, self.progress),
                judged=stack,
            )
        if made.diagnosis is None:
            yield Piece(
                f"looking for what {words} lacks, for the verdict",
                partial(session.diagnose, stack, self.progress),
                judged=stack,
            )
        if made.shares is None:
            yield Piece(
                f"weighing the causes of the residuals of {words}, for the list against",
                partial(session.weigh_causes, stack, self.progress),
                judged=stack,
            )
        if session.has_reference:
            for model in self._models_drawn(session):
                if model not in self.models:
                    yield Piece("computing the residuals over time, to draw them", partial(self._drawn_model, model))
        if session.second is not None:
            second = session.made(session.second)
            if second is None or second.comparison is None:
                yield Piece(
                    "computing the residuals of the kept model, for the figures",
                    partial(session.compare, session.second, self.progress),
                )
            if session.second.model != stack.model and session.weighed() is None:
                yield Piece(
                    "weighing the two models, for the one that the log prefers", partial(session.weigh, self.progress)
                )
        # Steps that were undone before the session was saved: their bars stand beside the others.
        yield from self._unfitted(session, session.steps[session.position + 1 :])

    def _unfitted(self, session: Session, steps: Sequence[Step]) -> Iterator[Piece]:
        for step in steps:
            if session.made(step.stack) is None:
                yield Piece(estimating(step.stack.model.effects), partial(session.fit, step.stack, self.progress))

    @staticmethod
    def _models_drawn(session: Session) -> list[Stack]:
        """List the models whose residuals are drawn: the present one, the ideal sensor, the kept one."""
        second = () if session.second is None else (session.second.model,)
        return list(dict.fromkeys((session.stack.model, Stack(), *second)))

    def _drawn_rows(self) -> Traces:
        """Make the pass over the rows of the log that is drawn; those read so far are shown meanwhile."""
        assert self.session is not None
        self._close(self.traces)
        self.traces = Traces(self.session.logs[self.session.shown])
        self.traces.build(self.progress)
        return self.traces

    def _drawn_model(self, model: Stack) -> ModelTraces:
        """Compute the residuals of a model over time, and forget those of models that are not shown."""
        assert self.session is not None
        assert self.traces is not None
        found = self.session.model_traces(self.traces, model)
        kept = self._models_drawn(self.session)
        self.models = {key: value for key, value in self.models.items() if key in kept} | {model: found}
        return found

    # --- files

    async def bring(self, files: Sequence[LogFile]) -> None:
        """Recognise files that were brought; a session is opened, and so is a single log, unless a model would be lost.

        Parameters
        ----------
        files : sequence of LogFile
            The files.
        """
        self.forget_trouble()
        if self.wanted is not None and {file.path.name for file in files} & {Path(n).name for n in self.wanted.names}:
            await self.reopen(self.wanted.session)
            return
        for file in files:
            if file.path.suffix.lower() == SESSION_ENDING and not any(
                other.path != file.path and other.path.stem == file.path.stem for other in files
            ):
                if self.unsaved:
                    self.kept_session = file.path
                    self.changed.emit()
                else:
                    await self.reopen(file.path)
                return
        for file in files:
            if file.path.suffix.lower() == SESSION_ENDING:
                continue
            found = await self._tried(f"reading {file.name}", lambda file=file: arrived(file), file)  # type: ignore[misc]
            if found is not None:
                self.arrivals = [item for item in self.arrivals if item.file.path != file.path] + [found]
        waiting = [offer for offer in self.offers if offer.way is not Way.OPEN]
        if len(self.arrivals) == 1 and not waiting and self.arrivals[0].sensors and not self.unsaved:
            await self.open(self.offers[0].files)
        self.changed.emit()

    async def open(self, files: Sequence[LogFile], mystery: Mystery | None = None) -> None:
        """Begin a session on logs.

        Parameters
        ----------
        files : sequence of LogFile
            The logs.
        mystery : Mystery, optional
            The game that is played on them.
        """
        opened = await self._opened(files)
        if opened is not None:
            session, joined = opened
            self._take(session, files, joined, mystery)
            await self.update()

    async def _opened(self, files: Sequence[LogFile]) -> tuple[Session, tuple[str, ...]] | None:
        def work() -> tuple[Session, tuple[str, ...]]:
            opened = [file.opened() for file in files]
            return Session([log for log, _ in opened]), tuple(words for _, joined in opened for words in joined)

        names = " and ".join(file.name for file in files)
        return await self._loaded(f"opening {names}", work, files[0])

    def _take(
        self, session: Session, files: Sequence[LogFile], joined: tuple[str, ...], mystery: Mystery | None
    ) -> None:
        """Show a session; the one before is kept until the evidence of this one is there."""
        if self.session is not None and self.session.begun:
            self._before = Shown(self.session, self.files, self.mystery, self.joined, self.traces, self.models)
        self._show(Shown(session, tuple(files), mystery, joined))
        self.arrivals, self.kept_session, self.wanted = [], None, None
        self._no_trouble()
        self.changed.emit()

    def _show(self, shown: Shown) -> None:
        self._close(self.traces)
        self.session, self.files, self.mystery, self.joined = shown.session, shown.files, shown.mystery, shown.joined
        self.traces, self.models = shown.traces, shown.models
        self.channel = self.covariate = None

    def _forget_before(self) -> None:
        """Close the session before: the present one stays."""
        if self._before is not None:
            before, self._before = self._before, None
            self._close(before.traces)

    def _close(self, traces: Traces | None) -> None:
        """Close traces that are not those of the session before."""
        if traces is not None and (self._before is None or traces is not self._before.traces):
            traces.close()

    async def mend(self, option: Option, number: int = 0) -> None:
        """Read a log of the session anew with one option of a fault's remedy, or the file that gave trouble.

        Parameters
        ----------
        option : Option
            The option.
        number : int
            Number of the log of the session.
        """
        try:
            if self.troubled is not None and option in self.cures:
                await self.bring([self.troubled.mended(option)])
                return
            files = [file.mended(option) if k == number else file for k, file in enumerate(self.files)]
        except InputError as error:
            self._note(str(error), [], None)
            self.changed.emit()
            return
        await self.open(files)

    async def remap(self, file: LogFile, text: str) -> None:
        """Read a file that was brought anew, with a mapping of its columns.

        A mapping that does not read the file leaves the question as it was, with the text that was typed.

        Parameters
        ----------
        file : LogFile
            The file.
        text : str
            Such as ``acc_x=AccX[g],acc_y=AccY[g]``.
        """
        asked = self.trouble, self.in_shell, self.cures, self.troubled
        try:
            mapping = Reading.of_texts([text], None, [], []).mapping or {}
        except InputError as error:
            self.typed, self.mistyped = text, f"In {file.name}: {error}"
            self.changed.emit()
            return
        mended = file.mended(("mapping", mapping))
        await self.bring([mended])
        if self.troubled != mended or mended in self.files:
            return
        # A question about other columns takes the place of the one that was answered.
        if not self.in_shell:
            self.mistyped = f"In {self.trouble}"
            self.trouble, self.in_shell, self.cures, self.troubled = asked
        self.typed = text
        self.changed.emit()

    async def reopen(self, path: Path) -> None:
        """Take up a session that was saved: its logs, its way, its models.

        Parameters
        ----------
        path : Path
            The file of the session.
        """

        def work() -> Kept | LogsWantedError:
            try:
                return read_session(path, self._folders())
            except LogsWantedError as wanted:
                return wanted

        kept = await self._tried(f"opening {path.name}", work)
        self.kept_session = None
        self.wanted = kept if isinstance(kept, LogsWantedError) else None
        if kept is None or isinstance(kept, LogsWantedError):
            self.changed.emit()
            return
        opened = await self._opened(kept.files)
        if opened is not None:
            session, joined = opened
            logs = " and ".join(file.path.name for file in kept.files)
            joined = (f"The session {path.name} was opened with {logs}.", *joined)
            session.go(kept.steps, kept.position)
            session.second = kept.second
            self._take(session, kept.files, joined, None)
            self._kept = self.saved()
            await self.update()

    def saved(self) -> str:
        """Return the text of the session's file.

        Raises
        ------
        InputError
            No log is open.
        """
        session = self.session
        if session is None:
            raise InputError("no log is open yet", remedy="Open a log first.")
        return as_toml(Kept(self.files, tuple(session.steps), session.position, session.second))

    def save(self) -> str:
        """Return the text of the session's file, and note that the person keeps it.

        Raises
        ------
        InputError
            No log is open.
        """
        self._kept = self.saved()
        return self._kept

    # --- the game

    def game_log(self) -> Path | None:
        """Return the log of the game, which no folder of the person holds."""
        return None if self.mystery is None else self.mystery.log

    async def play(self, level: int, seed: int) -> None:
        """Begin a game: a simulated log with a hidden effect.

        Parameters
        ----------
        level : int
            One of `imufit.studio.mystery.LEVELS`.
        seed : int
            Picks the log.
        """
        game = await self._loaded("hiding an effect", lambda: Mystery.hidden(level, seed, self.new_folder()))
        if game is not None:
            await self.open([LogFile(game.log, game.log.name)], game)
