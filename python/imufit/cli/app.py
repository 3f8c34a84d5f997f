"""The program ``imufit``: its commands, its exit codes, and one line on standard error for whatever goes wrong."""

from __future__ import annotations

import os
import sys
import traceback
import warnings
from collections.abc import Sequence

import click

from imufit.cli.names import OneOf, no_such_option
from imufit.cli.on_demand import Commands
from imufit.printable import MESSAGE, printable
from imufit.remedy import Reader, told_to

SUCCESS, INTERNAL, UNUSABLE, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 130, 141
"""Exit codes; the last two are those of a program that a signal ends, 128 + SIGINT and 128 + SIGPIPE."""
DEBUG = "IMUFIT_DEBUG"
_COMPLETE = "_IMUFIT_COMPLETE"
"""Variable by which a shell asks for completions."""
_LONGEST_MESSAGE = 3 * MESSAGE
"""Characters: place, problem and remedy, each of which is bounded."""


def _version(ctx: click.Context, _param: click.Parameter, wanted: bool) -> None:
    """Print the version and stop."""
    if wanted:
        from imufit import __version__  # noqa: PLC0415

        click.echo(f"imufit {__version__}")
        ctx.exit(SUCCESS)


def _completion(ctx: click.Context, _param: click.Parameter, shell: str | None) -> None:
    """Print the script for a shell and stop."""
    from click.shell_completion import get_completion_class  # noqa: PLC0415

    kind = None if shell is None else get_completion_class(shell)
    if kind is not None:
        click.echo(kind(imufit, {}, "imufit", _COMPLETE).source())
        ctx.exit(SUCCESS)


@click.group(cls=Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_version, help="Show the version.")
@click.option(
    "--completion",
    type=OneOf("shell", ("bash", "zsh", "fish")),
    is_eager=True,
    expose_value=False,
    callback=_completion,
    help="Print what completes commands, options, effects, filters and scenarios in this shell.",
)
@click.pass_context
def imufit(ctx: click.Context) -> None:
    """Find out which physical effect your inertial sensor model is missing, add it, and watch the error fall.

    LOG is a Parquet, CSV or NPZ table with one row per sample, or a serial transcript. `imufit demo` shows the whole
    loop on a made-up log. `eval "$(imufit --completion bash)"` completes commands and names, in zsh alike.
    """
    if ctx.invoked_subcommand is None:
        click.echo(ctx.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without it those of the process.

    Returns
    -------
    int
        0 on success, 2 on unusable input or arguments, 130 when interrupted, 141 when the reader of the output has
        gone, 1 on a fault of the program.
    """
    if _COMPLETE in os.environ:
        imufit.main(prog_name="imufit")
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        with warnings.catch_warnings(), told_to(Reader.SHELL):
            if not os.environ.get(DEBUG):
                warnings.simplefilter("ignore")
            return _run(given)
    except BrokenPipeError:
        # The remaining output is discarded at the end.
        for stream in (sys.stdout, sys.stderr):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        return PIPE_CLOSED


def _run(given: list[str]) -> int:
    """Run the program; return its exit code."""
    code = SUCCESS
    try:
        with imufit.make_context("imufit", given) as ctx:
            imufit.invoke(ctx)
    except BrokenPipeError:
        raise
    except Exception as error:
        code = _report(error)
    except KeyboardInterrupt:
        code = _fail("interrupted", INTERRUPTED)
    sys.stdout.flush()
    return code


def _report(error: Exception) -> int:
    """Say in one line what went wrong, and return the exit code."""
    if isinstance(error, click.exceptions.Exit):
        return error.exit_code
    if isinstance(error, click.exceptions.Abort):
        return _fail("interrupted", INTERRUPTED)
    message = _unusable(error)
    if message is not None:
        return _fail(message, UNUSABLE)
    if os.environ.get(DEBUG):
        traceback.print_exception(error)
        return INTERNAL
    return _fail(f"internal error: {type(error).__name__}: {error} ({DEBUG}=1 shows the traceback)", INTERNAL)


def _unusable(error: Exception) -> str | None:
    """Return what is wrong with the input or the arguments; None if the fault is the program's."""
    from imufit.errors import InputError  # noqa: PLC0415

    if isinstance(error, click.NoSuchOption):
        return no_such_option(error)
    if isinstance(error, click.ClickException):
        return error.format_message()
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename is not None else ""
        return f"{where}{error.strerror or error}"
    return str(error) if isinstance(error, InputError) else None


def _fail(message: str, code: int) -> int:
    """Print one line on standard error."""
    sys.stderr.write(f"imufit: {printable(' '.join(message.split()), _LONGEST_MESSAGE)}\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
