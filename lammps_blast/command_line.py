"""The console script `lammps-blast`: one name for the package's commands."""

import contextlib
import os
import sys
from typing import NoReturn, TextIO

USAGE = """usage: lammps-blast COMMAND ...

commands:
  run      run a case and draw its figures       (python -m lammps_blast.run)
  theory   print a case's derived numbers        (python -m lammps_blast.theory)
  analyze  analyse a run folder or a dump        (python -m lammps_blast.analyze)
  deck     write a case's LAMMPS deck and data   (python -m lammps_blast.deck)
  doctor   look over the installation            (python -m lammps_blast.doctor)
  lmp      LAMMPS itself, which heeds signals    (python -m lammps_blast.lammps_program)

`lammps-blast COMMAND --help` tells more."""

# Exit statuses.
DONE, INVALID, FAILED, INTERRUPTED = 0, 2, 3, 130
OUT_OF_MEMORY = "the memory is used up: take fewer particles, or a larger machine"


def main(argv: list[str] | None = None) -> int:
    """Hand the arguments after the command's name to that command; return its exit status."""
    arguments = sys.argv[1:] if argv is None else argv
    command, rest = (arguments[0], arguments[1:]) if arguments else ("--help", [])
    if command == "run":
        from lammps_blast.run import main as chosen
    elif command == "theory":
        from lammps_blast.theory import main as chosen
    elif command == "analyze":
        from lammps_blast.analyze import main as chosen
    elif command == "deck":
        from lammps_blast.deck import main as chosen
    elif command == "lmp":
        from lammps_blast.lammps_program import main as chosen
    elif command == "doctor":
        from lammps_blast.doctor import main as chosen
    else:
        print(USAGE, file=sys.stdout if command in ("-h", "--help") else sys.stderr)
        return 0 if command in ("-h", "--help") else 2
    return chosen(rest)


def tell(text: object, stream: TextIO | None = None) -> None:
    """Print what may quote the name of a file, to standard output if nowhere else.

    Where that is closed, full or not read, it is lost, and that is no error.
    """
    stream = stream or sys.stdout
    if stream is None:
        return
    try:
        print(shown_text(str(text), stream.encoding), file=stream, flush=True)
    except OSError:
        send_to_nobody(stream)


def leave_at_once(status: int) -> NoReturn:
    """End this process without what Python, and libraries at work in it, do at their end."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # none, full or closed
            stream.flush()
    os._exit(status)


def send_to_nobody(stream: TextIO) -> None:
    """Lose what is still to be written to a stream, which Python would fail at in the end."""
    with contextlib.suppress(OSError), open(os.devnull, "wb") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


def shown_text(text: str, encoding: str | None) -> str:
    """Return a text in which nothing harms a terminal of some encoding.

    Control characters, with which the name of a file could write to a terminal what it likes, and
    characters that the encoding lacks are escaped.
    """
    escaped = "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )
    encoding = encoding or "ascii"
    return escaped.encode(encoding, "backslashreplace").decode(encoding)


if __name__ == "__main__":
    sys.exit(main())
