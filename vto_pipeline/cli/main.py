"""The command `vto`: one file per command, loaded when it is called, and the place where errors become messages."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module

import click

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy loads: its sums depend on the thread count

from vto_pipeline import __version__
from vto_pipeline.cli.interrupts import Interrupts
from vto_pipeline.cli.session import Session
from vto_pipeline.errors import ConfigError, InputError, MissingDependencyError, VtoError
from vto_pipeline.io.stalls import STALLED

COMMANDS = {
    "scan": "Reconstruct a garment or a body from photos, depth frames, a cloud or a mesh.",
    "fit": "Fit an avatar to a body scan, measurements or two photos.",
    "drape": "Drape a garment on a body.",
    "run": "Run a pipeline document.",
    "batch": "Run a document many times, with the changes of a table.",
    "status": "Show what has become of every row of a batch.",
    "cancel": "End a run or a batch that is at work; it can be resumed.",
    "pattern": "Measure a sewing pattern, and write it in another format.",
    "between": "Make the size between two patterns, or between two meshes.",
    "tryon": "Make a page with sliders from a batch of drapes.",
    "advise": "Advise a customer on a size: the best one, the runner-up, and the reason.",
    "fabric": "Measure a fabric's bending rigidity from hanging strips.",
    "motion": "Show what a motion holds, and carry it over to an avatar.",
    "stream": "Move a run's avatar and garment live, after a camera's skeletons.",
    "info": "Describe a run, or a file or folder that may be given.",
    "prune": "Remove stored results that a run or a batch no longer needs.",
    "plan": "Show what a document would run, without running it.",
    "bench": "Measure error against run time and plot it.",
    "report": "Rebuild the page of a run.",
    "view": "Show the page of a run in the browser.",
    "render": "Draw pictures of what a run made, or of a mesh.",
    "stages": "List all stages.",
    "schema": "Print the JSON schema of a pipeline document.",
    "doctor": "Check the installation and show how to fix it.",
}
"""Name of a command and of its file -> one line of help; kept here so that `vto --help` loads none of them."""

INTERRUPTED = 130

ADVICE = {
    **dict.fromkeys((errno.EACCES, errno.EPERM, errno.ELOOP, errno.ENAMETOOLONG), ""),
    errno.EROFS: "nothing can be written there; -o gives another folder",
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "make room; the same command again resumes where this one stopped"),
    **dict.fromkeys(
        (errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.EHOSTDOWN, errno.ENOTCONN),
        STALLED,
    ),
    **dict.fromkeys(
        (errno.EEXIST, errno.ENOTDIR, errno.EISDIR), "a file stands where a folder is meant, or the reverse"
    ),
    errno.EMFILE: "raise the limit of open files: ulimit -n",
}
"""What an operating system answers when a file, a right or the disk is at fault, and not our own code -> what to do."""


class _LazyGroup(click.Group):
    """Commands that are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(import_module(f"vto_pipeline.cli.commands.{cmd_name}"), f"{cmd_name}_command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            close = get_close_matches(args[0], COMMANDS, n=1)
            hint = f"did you mean {close[0]}?" if close else f"one of {', '.join(COMMANDS)}"
            raise click.UsageError(f"no such command: {args[0]}\n  hint: {hint}", ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(cls=_LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="vto")
def vto() -> None:
    """From scans of garments and people to a dressed avatar, with every error and time reported.

    \b
    vto run configs/demo.yaml                 a shirt from photos, on a customer
    vto scan photos/ --role garment           a garment from photos
    vto fit --measurements customer.yaml      an avatar from a tape
    vto drape --garment shirt.ply --body customer.npz --fabric denim
    """


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line.

    Args:
        arguments: Without the program's name; None: the process's own.

    Returns:
        The exit code: 0 done, 2 bad usage, config or plan, 3 bad input, 4 failed computation, 5 missing dependency,
        6 a batch ended with failures, 130 interrupted. Our own bugs (1) are left to Python, with their traceback.
    """
    session, interrupts = Session(), Interrupts()
    try:
        code = vto.main(args=arguments, prog_name="vto", standalone_mode=False, obj=session)
        return code if isinstance(code, int) else 0
    except VtoError as error:
        return session.fail(error)
    except click.ClickException as error:
        error.show(sys.stderr)
        session.answer_error(ConfigError(error.format_message()))
        return error.exit_code
    except OSError as error:
        if error.errno not in ADVICE:
            raise
        problem, hint = f"the system refuses: {error.strerror}", ADVICE[error.errno]
        return session.fail(InputError(problem, where=str(error.filename or ""), hint=hint))
    except (click.Abort, KeyboardInterrupt):
        return _interrupted()
    except ImportError as error:
        if (error.name or "").startswith("vto_pipeline"):
            raise
        return session.fail(MissingDependencyError(f"cannot load a library: {error}", hint="run `vto doctor`"))
    except Exception:
        # Numba's compiler, for one, loses an interrupt and then stumbles over it.
        if interrupts.seen:
            return _interrupted()
        raise
    finally:
        interrupts.close()


def _interrupted() -> int:
    click.echo("interrupted; run the same command again to resume", err=True)
    return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
