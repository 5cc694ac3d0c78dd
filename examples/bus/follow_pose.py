"""Prints the robot's pose in the map, live, as CSV.

    randt layout --python > randt_bus.py
    pip install numpy iceoryx2==0.10.0
    python follow_pose.py [--prefix NAME] [--run DIR] [--scans N]
"""

import argparse
import math

from randt_bus import CODES, Bus


def transformed(a, b):
    """The pose `b` (x m, y m, yaw rad), which is given in `a`, in the frame that `a` is given in."""
    x, y, yaw = a
    cos, sin = math.cos(yaw), math.sin(yaw)
    turned = yaw + b[2]
    return (
        x + cos * b[0] - sin * b[1],
        y + sin * b[0] + cos * b[1],
        math.atan2(math.sin(turned), math.cos(turned)),
    )


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--prefix", default="randt")
    arguments.add_argument("--run")
    arguments.add_argument("--scans", type=int, help="end after that many")
    arguments = arguments.parse_args()

    bus = Bus(arguments.prefix, arguments.run)
    states = bus.subscribe("odometry/state/v1")
    corrections = bus.subscribe("mapper/correction/v1")
    # The newest place of each odometry frame in the map. A frame that has none yet is not joined
    # to the map: its poses are only true within it.
    map_from_odom = {}

    print("stamp_ns,frame,x_m,y_m,yaw_rad,trust", flush=True)
    for count, state in enumerate(states, start=1):
        while (correction := corrections.receive()) is not None:
            frame = int(correction.head["odom_frame_id"])
            map_from_odom[frame] = correction.head["map_from_odom"]
        head = state.head
        frame, place, pose = int(head["odom_frame_id"]), "odom", head["pose"]
        if frame in map_from_odom:
            place, pose = "map", transformed(map_from_odom[frame], pose)
        trust = CODES["OdometryState.trust"][int(head["trust"])]
        stamp_ns = int(head["header"]["stamp_ns"])
        x_m, y_m, yaw_rad = pose
        print(f"{stamp_ns},{place},{x_m:.4f},{y_m:.4f},{yaw_rad:.5f},{trust}", flush=True)
        if count == arguments.scans:
            break


if __name__ == "__main__":
    main()
