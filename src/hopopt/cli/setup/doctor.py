"""The command that looks at the installation: doctor."""

from dataclasses import asdict

from hopopt.cli.options import AsJson, progress


def doctor(*, json_: AsJson = False) -> int:
    """Check this installation, with a self-test.

    It looks at versions, solvers, the compiler and the cache; some seconds.

    Exit code: 0 all that hopopt needs works, 1 not.
    """
    from hopopt.cli.setup.installation import findings
    from hopopt.storage.folder import as_json

    with progress(quiet=json_) as say:
        found = []
        for finding in findings():
            say(f"looked at {finding.name}")
            found.append(finding)
    code = 0 if all(f.ok for f in found if f.needed) else 1
    if json_:
        print(as_json({"works": code == 0, "exit_code": code, "findings": [asdict(f) for f in found]}))
    else:
        from hopopt.cli.screen.doctor import print_findings

        print_findings(found)
    return code
