"""Sends the robot's pose to a flight controller, live, as MAVLink's ODOMETRY.

    randt layout --python > randt_bus.py
    pip install numpy iceoryx2==0.10.0 pymavlink==2.4.50
    python send_mavlink.py [--to udpout:HOST:14550 | --to /dev/ttyACM0] [--prefix NAME] [--run DIR]

The pose is that in `odom`, which never jumps; the controller's own filter wants no other. MAVLink
has forward, right, down where randt has forward, left, up: y, z and the turns about them change
their signs. PX4 takes this message as vehicle_visual_odometry, ArduPilot with VISO_TYPE 1. Height
is not known and sent as 0: leave it out (PX4: EKF2_EV_CTRL 9, place and heading alone).
Tried against pymavlink's decoder, never with a flight controller.
"""

import argparse
import math
import os

os.environ["MAVLINK20"] = "1"  # ODOMETRY is of MAVLink 2.

import numpy as np
from pymavlink import mavutil
from randt_bus import CODES, Bus

MAVLINK = mavutil.mavlink
# From forward, left, up to forward, right, down: of x, y, yaw.
FRD_FROM_FLU = np.diag([1.0, -1.0, -1.0])
# In percent, as MAVLink has it; -1: has failed.
QUALITY = {"good": 100, "degraded": 20, "lost": -1}
# Variance of the height, which a radar in a plane does not measure, m^2.
UNKNOWN = 1e6
# Roll and pitch are the attitude filter's, rad^2: 2 degrees.
TILT_VARIANCE = 0.035**2


def orientation(yaw, attitude):
    """The quaternion w, x, y, z of `base_link` in `odom`, both forward, right, down."""
    cos, sin = math.cos(yaw / 2), math.sin(yaw / 2)
    w, x, y, z = attitude
    turned = (cos * w - sin * z, cos * x - sin * y, cos * y + sin * x, cos * z + sin * w)
    return [turned[0], turned[1], -turned[2], -turned[3]]


def pose_covariance(yaw, covariance):
    """The upper triangle over x, y, z, roll, pitch, yaw. randt's is in `base_link`, MAVLink's in
    the frame of the pose."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    turn = FRD_FROM_FLU @ np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    whole = np.diag([0, 0, UNKNOWN, TILT_VARIANCE, TILT_VARIANCE, 0])
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    whole[plane] = turn @ np.reshape(covariance, (3, 3)) @ turn.T
    return whole[np.triu_indices(6)].tolist()


def message(state, resets):
    """ODOMETRY of a state; `resets` counts the frames `odom` that were opened."""
    x, y, yaw = (float(value) for value in state["pose"])
    forward, left, turning = (float(value) for value in state["velocity"])
    unknown = [math.nan] + [0.0] * 20
    return MAVLINK.MAVLink_odometry_message(
        time_usec=int(state["header"]["stamp_ns"]) // 1000,
        frame_id=MAVLINK.MAV_FRAME_LOCAL_FRD,
        child_frame_id=MAVLINK.MAV_FRAME_BODY_FRD,
        x=x,
        y=-y,
        z=0.0,
        q=orientation(yaw, [float(value) for value in state["attitude"]]),
        vx=forward,
        vy=-left,
        vz=0.0,
        rollspeed=0.0,
        pitchspeed=0.0,
        yawspeed=-turning,
        pose_covariance=pose_covariance(yaw, state["covariance"]),
        velocity_covariance=unknown,
        reset_counter=resets % 256,
        # Of what PX4 takes, the nearest: motion from a sensor of surroundings and an IMU.
        estimator_type=MAVLINK.MAV_ESTIMATOR_TYPE_VIO,
        quality=QUALITY[CODES["OdometryState.trust"][int(state["trust"])]],
    )


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--to", default="udpout:127.0.0.1:14550", help="as pymavlink has it")
    arguments.add_argument("--baud", type=int, default=921600)
    arguments.add_argument("--prefix", default="randt")
    arguments.add_argument("--run")
    arguments.add_argument("--scans", type=int, help="end after that many")
    arguments = arguments.parse_args()

    component = MAVLINK.MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY
    link = mavutil.mavlink_connection(
        arguments.to, baud=arguments.baud, source_system=1, source_component=component
    )
    frame, resets = None, 0
    states = Bus(arguments.prefix, arguments.run).subscribe("odometry/state/v1")
    for count, state in enumerate(states, start=1):
        opened = int(state.head["odom_frame_id"])
        resets += frame is not None and opened != frame
        frame = opened
        link.mav.send(message(state.head, resets))
        if count == arguments.scans:
            break


if __name__ == "__main__":
    main()
