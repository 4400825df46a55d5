"""A companion beside a MAVSDK script: the script flies the target, the companion escorts it.

Needs ``pip install 'mavsdk<4'``. Two simulated ArduCopters are started: MAVSDK flies the first
and knows nothing of the second. `outrider fly` reads where the first is from its telemetry, and leads the
second around it. With real vehicles only the addresses change (docs/fly.md).
"""

import asyncio
import json
import subprocess
import sys
import tempfile

from mavsdk import System
from mavsdk.action import ActionError

BASE = int(sys.argv[1]) if len(sys.argv) > 1 else 5760
TARGET, ESCORT, TELEMETRY = BASE + 100, BASE, BASE + 500
SITL = ["outrider", "sitl", "--flavour", "ardupilot", "--json"]


async def first(stream, is_wanted):
    """Return the first item of a telemetry stream that is wanted."""
    async for item in stream:
        if is_wanted(item):
            return item
    raise RuntimeError("the stream ended")


async def fly_target(drone: System) -> None:
    """Take off, fly 15 m to the north, and stay there."""
    await drone.connect(system_address=f"tcpout://127.0.0.1:{TARGET}")
    await first(drone.core.connection_state(), lambda state: state.is_connected)
    # ArduCopter tells only what it is asked for; its place is what the companion follows.
    await drone.telemetry.set_rate_health(2.0)
    await drone.telemetry.set_rate_position(10.0)
    await first(drone.telemetry.health(), lambda health: health.is_armable)
    await drone.action.set_takeoff_altitude(3.0)
    await drone.action.arm()
    await drone.action.takeoff()
    home = await first(drone.telemetry.position(), lambda place: place.relative_altitude_m > 2.5)
    north, height = home.latitude_deg + 15.0 / 111_320.0, home.absolute_altitude_m
    try:
        await drone.action.goto_location(north, home.longitude_deg, height, 0.0)
    except ActionError as error:
        print("the target stays where it is:", error)
    await first(drone.telemetry.position(), lambda place: abs(place.latitude_deg - north) < 1e-5)
    print("the target is 15 m further north")


async def main() -> None:
    """Start the simulations and the companion, fly the target, and print what the companion did."""
    drone, processes = System(port=BASE + 1000), []
    try:
        for first_id, port, more in (
            (1, ESCORT, ()),
            (100, TARGET, ("--to", f"udpout:127.0.0.1:{TELEMETRY}", "--origin", "47.397842,8.545594,488")),
        ):
            options = ["--first-id", str(first_id), "--port-base", str(port), *more]
            simulation = subprocess.Popen([*SITL, *options], stdout=subprocess.PIPE, text=True)
            processes.append(simulation)
            simulation.stdout.readline()  # one line of JSON when the vehicle is up
        companion = subprocess.Popen(
            [
                *("outrider", "fly", "--config", "ardupilot", "--system", "1", "--go", "--json"),
                *("--autopilot", f"tcp:127.0.0.1:{ESCORT}", "--swarm", f"udpin:127.0.0.1:{TELEMETRY}"),
                *("--seconds", "60", "--out", tempfile.mkdtemp(prefix="outrider-")),
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        processes.append(companion)
        await asyncio.wait_for(fly_target(drone), 120.0)
        said = await asyncio.to_thread(companion.communicate)
        summary = json.loads(said[0].splitlines()[-1])
        phases = ", ".join(one["phase"] for one in summary["phases"])
        print(f"the companion of vehicle {summary['system']}: {phases}; then it {summary['last_word']}")
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()
        drone._stop_mavsdk_server()


asyncio.run(main())
