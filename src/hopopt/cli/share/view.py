"""The command that shows a hop in three dimensions in a browser: view."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson
from hopopt.plots.scene import HopScene, quiet, serve
from hopopt.problem.urdf.looks import looks_if_known, looks_of
from hopopt.storage.folder import as_json, fitting
from hopopt.storage.motions import read_plan


def view(
    result: Annotated[Path, Parameter(help="A folder that hopopt solve or hopopt robust wrote.")],
    *,
    leg: str | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    json_: AsJson = False,
) -> int:
    """Show a solved hop in three dimensions in a browser.

    With a time slider, until Ctrl-C. Links look as the URDF says where its meshes lie on disk, else as cylinders.

    Parameters
    ----------
    leg
        The problem file with the URDF, for its meshes (default: the built-in problem that the hop is of, if any).
    host
        The address to listen at; with the default only this computer can see the page.
    port
        The port to listen at; 0: any that is free.
    """
    with fitting(result):
        hop = read_plan(result)[0].motion
        joints = hop.robot.joints
        looks = looks_of(leg, joints) if leg else looks_if_known(hop.design.name, joints)
    server = serve(host, port)
    try:
        with fitting(result):
            scene = HopScene(server, hop, looks)
        address = f"http://{host}:{server.get_port()}"
        if json_:
            print(as_json({"address": address, "links": scene.drawn, "exit_code": 0}), flush=True)
        else:
            shown = ", ".join(f"{link} as {look}" for link, look in scene.drawn.items())
            print(f"{result}: open {address} in a browser; Ctrl-C ends it ({shown})", flush=True)
        scene.run()
    except KeyboardInterrupt:
        return 0
    finally:
        with quiet():
            server.stop()
    return 0
