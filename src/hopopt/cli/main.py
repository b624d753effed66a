"""The command line: its commands in groups, and the entry point. A command's module is imported when it runs."""

import gc
import json
import signal
import sys

from cyclopts import App, CycloptsError, Group

from hopopt.errors import HopoptError, NotSolvedError, UsageError

COMMANDS = {  # group of the help page -> command -> where its function is; in the order in which they are shown
    "The answer": {
        "solve": "hopopt.cli.answer.solve:solve",
        "new": "hopopt.cli.answer.new:new",
        "show": "hopopt.cli.answer.show:show",
        "verify": "hopopt.cli.answer.verify:verify",
        "repair": "hopopt.cli.answer.verify:repair",
        "diagnose": "hopopt.cli.answer.diagnose:diagnose",
        "evidence": "hopopt.cli.answer.evidence:evidence",
    },
    "Controllers": {
        "compare": "hopopt.cli.controllers.compare:compare",
        "simulate": "hopopt.cli.controllers.simulate:simulate",
        "robust": "hopopt.cli.controllers.robust:robust",
        "tune": "hopopt.cli.controllers.tune:tune",
    },
    "Hop after hop (also: solve and compare, with --hop periodic)": {
        "transition": "hopopt.cli.hops.transition:transition",
    },
    "Studies": {
        "sensitivity": "hopopt.cli.studies.sensitivity:sensitivity",
        "sweep": "hopopt.cli.studies.sweep:sweep",
        "pareto": "hopopt.cli.studies.pareto:pareto",
        "families": "hopopt.cli.studies.families:families",
    },
    "To share": {
        "report": "hopopt.cli.share.report:report",
        "animate": "hopopt.cli.share.animate:animate",
        "view": "hopopt.cli.share.view:view",
        "export": "hopopt.cli.share.export:export",
    },
    "A robot's data": {
        "log": "hopopt.cli.robot_data.log:log",
        "identify": "hopopt.cli.robot_data.identify:identify",
    },
    "The paper": {
        "reproduce": "hopopt.cli.paper.reproduce:reproduce",
        "calibrate": "hopopt.cli.paper.calibrate:calibrate",
    },
    "Set-up": {
        "doctor": "hopopt.cli.setup.doctor:doctor",
        "actuators": "hopopt.cli.setup.actuators:actuators",
        "schema": "hopopt.cli.setup.schema:schema",
    },
}
QUESTION = "How high can a leg possibly lift its foot in a hop with the motors it has?"
BEGIN = f"""{QUESTION}

Begin with:

  hopopt solve         the highest hop of the paper's leg, in less than a minute
  hopopt new my_leg    a problem file for a leg of your own, to change and solve
  hopopt compare       how near controllers come to the highest hop

hopopt --help lists all commands, and hopopt solve --help all that solve can do."""


def command_line() -> App:
    """All commands, none of them imported yet; where to start is said on the first page alone."""
    made = App(
        name="hopopt",
        help=QUESTION,
        help_epilogue="Start with: hopopt solve --objective clearance",
        help_format="plaintext",  # of the first page: to import Markdown would take a quarter of its time
        version_flags=["--version"],
        suppress_keyboard_interrupt=False,  # run says what became of the work
    )
    groups = [Group(title, sort_key=place) for place, title in enumerate(COMMANDS)]
    for group, commands in zip(groups, COMMANDS.values(), strict=True):
        for row, (name, path) in enumerate(commands.items()):
            made.command(path, name=name, group=group, sort_key=row, help_format="markdown", help_epilogue="")
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
    words = sys.argv[1:] if arguments is None else arguments
    try:
        if any("\0" in word for word in words):
            raise UsageError("an argument holds a NUL character, which no name and no number has")
        if not words:
            print(BEGIN)
            return 0
        if words[0] in app.help_flags:
            app.resolved_commands()  # the page has the first sentence of each command's docstring
        result = app(
            arguments, exit_on_error=False, print_error=False, result_action="return_value", help_on_error=False
        )
        return result if isinstance(result, int) else 0
    except CycloptsError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        command = f"{words[0]} " if words and words[0] in app else ""
        print(f"Try: hopopt {command}--help", file=sys.stderr)
        return 2
    except HopoptError as error:
        print(f"hopopt: {error}", file=sys.stderr)
        if isinstance(error, NotSolvedError) and "--json" in words:
            failure = {"status": "not solved", "verified": False, "exit_code": 1, "clearance_m": None}
            print(json.dumps({**failure, "message": str(error), "diagnosis": error.diagnosis}))
        return error.exit_code
    except KeyboardInterrupt:
        print("hopopt: interrupted; nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:
        return 0
    except OSError as error:  # of a file or folder that no command expected to be as it is
        from hopopt.storage.folder import reason_of

        where = f"{error.filename!s:.200}: " if error.filename else ""
        print(f"hopopt: {where}{reason_of(error)}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    main()
