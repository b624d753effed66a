"""The command line: its commands in groups, and the entry point. A command's module is imported when it runs."""

import gc
import json
import signal
import sys
from typing import Any

from cyclopts import App, CycloptsError, Group

from hopopt.errors import HopoptError, NotSolvedError, UsageError

COMMANDS = {  # group of the help page -> command -> where its function is, and its line there; in the order of the page
    "The answer": {
        "solve": ("answer.solve", "Find the highest hop of a leg, verify it, and save it."),
        "new": ("answer.new", "Write a problem file for a leg of your own, with comments."),
        "show": ("answer.show", "Print a stored answer whole, or a problem with all its entries."),
        "verify": ("answer.verify", "Check a stored result again, from its files alone."),
        "repair": ("answer.verify", "Recompute a result whose files were changed, in a new folder."),
        "diagnose": ("answer.diagnose", "Say what in a stored hop does not matter: times, motions, limits."),
        "evidence": ("answer.evidence", "Say how far the best hop may be trusted to be the best."),
    },
    "Controllers": {
        "compare": ("controllers.compare", "Compare the paper's controllers, or yours, with the optimum."),
        "simulate": ("controllers.simulate", "Simulate hops of the leg with one controller."),
        "robust": ("controllers.robust", "Find the best plan for legs whose masses and motors vary."),
        "tune": ("controllers.tune", "Tune the gains of the paper's PD control by simulation."),
    },
    "Hop after hop (also: solve and compare, with --hop periodic)": {
        "transition": ("hops.transition", "Find the fewest hops from rest onto a hop that repeats itself."),
    },
    "Studies": {
        "sensitivity": ("studies.sensitivity", "Say what to change first: what 1 % more of each value brings."),
        "sweep": ("studies.sweep", "Solve a problem at many values of one entry or several."),
        "choose": ("studies.choose", "Find the motors and gears that lift the foot so high."),
        "pareto": ("studies.pareto", "Find the least energy, force or time for each clearance."),
        "explore": ("studies.explore", "Drag the leg's numbers on a live page, and watch it hop."),
        "families": ("studies.families", "Tell which kinds of hop a leg has, in words and a picture."),
    },
    "To share": {
        "report": ("share.report", "Write results as one HTML page, with the hop moving."),
        "animate": ("share.animate", "Write hops as a moving picture: GIF, SVG or MP4."),
        "view": ("share.view", "Show a solved hop in three dimensions in a browser."),
        "export": ("share.export", "Write a planned hop for a robot, or the leg for other simulators."),
    },
    "A robot's data": {
        "log": ("robot_data.log", "Read a robot's hop from its log, and compare it with the optimum."),
        "identify": ("robot_data.identify", "Find a leg's masses, motor constants and losses from its logs."),
    },
    "The paper": {
        "reproduce": ("paper.reproduce", "Print the paper's results beside those of the simulation."),
        "calibrate": ("paper.calibrate", "Find the motor from the jump heights that the paper reports."),
    },
    "Set-up": {
        "doctor": ("setup.doctor", "Check this installation, with a self-test."),
        "actuators": ("setup.actuators", "List the motors and gears that a problem can name."),
        "schema": ("setup.schema", "Print the JSON schema of problem or result files."),
    },
}
QUESTION = "How high can a leg possibly lift its foot in a hop with the motors it has?"
WITH = "--with"  # of every command
BEGIN = f"""{QUESTION}

Begin with:

  hopopt solve         the highest hop of the paper's leg, in less than a minute
  hopopt new my_leg    a problem file for a leg of your own, to change and solve
  hopopt compare       how near controllers come to the highest hop

hopopt --help lists all commands, and hopopt solve --help all that solve can do."""


def command_line(first_page: bool = False) -> App:
    """All commands, none of them imported; where to start is said on the first page alone.

    first_page: their names and lines alone, for the list of commands and for a name that is none
    """
    made = App(
        name="hopopt",
        help=QUESTION,
        help_epilogue=f"Start with: hopopt solve --objective clearance\n\n{WITH} my_module goes with every command: a module of your own.",
        help_format="plaintext",  # of the first page: to import Markdown would take a quarter of its time
        version_flags=["--version"],
        suppress_keyboard_interrupt=False,  # run says what became of the work
    )
    groups = [Group(title, sort_key=place) for place, title in enumerate(COMMANDS)]
    for group, commands in zip(groups, COMMANDS.values(), strict=True):
        for row, (name, (module, line)) in enumerate(commands.items()):
            place: dict[str, Any] = {"name": name, "group": group, "sort_key": row}
            if first_page:
                made.command(App(help=line, **place))
            else:
                made.command(f"hopopt.cli.{module}:{name}", **place, help_format="markdown", help_epilogue="")
    complete = "Let the shell complete commands and options.\n\nOf bash, zsh and fish."
    made.register_install_completion_command(help=complete, group=groups[-1], help_epilogue="")
    for flag in ("--help", "--version"):
        made[flag].group = groups[-1]
    return made


app = command_line()


def main(arguments: list[str] | None = None) -> None:
    """Entry point: runs a command and exits with its code; every expected fault is a sentence on standard error."""
    _ended_as_by_ctrl_c(signal.SIGTERM, signal.SIGHUP)
    gc.set_threshold(100_000)  # imports leave no garbage in cycles: less search for it is a tenth of a cold answer
    code = run(arguments)
    gc.freeze()  # nor is there any to look for on the way out
    sys.exit(code)


def _ended_as_by_ctrl_c(*signals: signal.Signals) -> None:
    """So that what is known is kept, and the processes of a search end too; nohup ignores SIGHUP, and so do we then."""
    for each in signals:
        if signal.getsignal(each) is signal.SIG_DFL:
            signal.signal(each, signal.default_int_handler)


def run(arguments: list[str] | None = None) -> int:
    """Run one command line and return its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if any("\0" in word for word in words):
            raise UsageError("an argument holds a NUL character, which no name and no number has")
        if not (words := with_modules(words)):
            print(BEGIN)
            return 0
        named = words[0] in app and words[0] not in app.help_flags
        asked = app if named else command_line(first_page=True)
        result = asked(words, exit_on_error=False, print_error=False, result_action="return_value", help_on_error=False)
        return result if isinstance(result, int) else 0
    except CycloptsError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        command = f"{words[0]} " if words and words[0] in app else ""
        print(_entry_meant(words) or f"Try: hopopt {command}--help", file=sys.stderr)
        return 2
    except HopoptError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        if isinstance(error, NotSolvedError) and "--json" in words:
            failure = {"status": "not solved", "verified": False, "exit_code": 1, "clearance_m": None}
            print(json.dumps({**failure, "message": str(error), "diagnosis": error.diagnosis}))
        return error.exit_code
    except KeyboardInterrupt as stopped:  # a command that keeps what it has says so
        print(f"hopopt: {str(stopped) or 'interrupted; nothing was written'}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:  # of a file or folder that no command expected to be as it is
        from hopopt.storage.folder import reason_of

        where = f"{error.filename!s:.200}: " if error.filename else ""
        print(f"hopopt: {where}{reason_of(error)}", file=sys.stderr)
        return 2


def with_modules(words: list[str]) -> list[str]:
    """The words of a command line without ``--with my_module``, each of these modules of the user's own imported."""
    rest, modules = list[str](), list[str]()
    given = iter(words)
    for word in given:
        if word == WITH or word.startswith(f"{WITH}="):
            modules.append(word.partition("=")[2] or next(given, ""))
        else:
            rest.append(word)
    if modules:
        from hopopt.extensions import load

        for module in modules:
            load(module)
    return rest


def _entry_meant(words: list[str]) -> str:
    """How to set the entry of a problem that was given as an option, such as --friction 0.6; empty if there is none."""
    from hopopt.problem.checking.entries import homes

    for option, value in zip(words, [*words[1:], ""], strict=True):
        name, _, given = option.removeprefix("--").replace("-", "_").partition("=")
        places = [at.strip("[]") for at in homes(name) if at.startswith("[")] if option.startswith("--") else []
        first = [
            at for at in places if "<" not in at and at != "uncertainty"
        ]  # a leg's before a joint's, and its spread
        first = [at for at in first if not at.startswith("leg.")] or first  # the ground's friction before a gear's
        if len(first) == 1 and (given or value):
            path = f"{first[0]}.{name}"
            return f"Try: --set {path}={given or value}, for {path} is an entry of the problem"
    return ""


if __name__ == "__main__":
    main()
