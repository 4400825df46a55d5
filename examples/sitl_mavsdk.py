"""The simulated autopilot, flown by MAVSDK-Python 3: take off, fly a velocity, land.

Needs ``pip install 'mavsdk<4'``, and ``outrider`` on the path. MAVSDK takes the simulation for a PX4 vehicle.
"""

import asyncio
import subprocess
import sys

from mavsdk import System
from mavsdk.offboard import VelocityNedYaw

PORT = int(sys.argv[1]) if len(sys.argv) > 1 else 14540


async def first(stream, is_wanted):
    """Return the first item of a telemetry stream that is wanted."""
    async for item in stream:
        if is_wanted(item):
            return item
    raise RuntimeError("the stream ended")


async def fly(drone: System) -> None:
    """Fly the vehicle and print where it is."""
    await drone.connect(system_address=f"udpin://127.0.0.1:{PORT}")
    await first(drone.core.connection_state(), lambda state: state.is_connected)
    await first(drone.telemetry.health(), lambda health: health.is_armable)
    await drone.action.arm()
    await drone.action.takeoff()
    await first(drone.telemetry.position(), lambda place: place.relative_altitude_m > 2.0)
    await drone.offboard.set_velocity_ned(VelocityNedYaw(2.0, 0.0, 0.0, 0.0))
    await drone.offboard.start()
    await asyncio.sleep(2.0)
    motion = await first(drone.telemetry.position_velocity_ned(), lambda _: True)
    print(f"after two seconds: {motion.position.north_m:.1f} m north, {motion.velocity.north_m_s:.1f} m/s")
    await drone.offboard.stop()
    await drone.action.land()
    await first(drone.telemetry.armed(), lambda armed: not armed)
    print("landed")


async def main() -> None:
    """Start the simulation, and fly it."""
    command = ["outrider", "sitl", "--flavour", "px4", "--port-base", str(PORT), "--speedup", "2"]
    drone = System(port=PORT + 1000)
    simulation = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        await asyncio.wait_for(fly(drone), 120.0)
    finally:
        simulation.terminate()
        simulation.wait()
        drone._stop_mavsdk_server()  # it would outlive a program that ends with an error


asyncio.run(main())
