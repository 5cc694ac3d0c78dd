"""Decodes datagrams that are given in hexadecimal by pymavlink; prints a line of JSON for each."""

import json
import math
import os
import sys

os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil
from pymavlink.quaternion import Quaternion

MAVLINK = mavutil.mavlink

for datagram in sys.argv[1:]:
    (message,) = MAVLINK.MAVLink(None).parse_buffer(bytes.fromhex(datagram))
    fields = message.to_dict()
    fields["euler_deg"] = [math.degrees(angle) for angle in Quaternion(fields["q"]).euler]
    fields["frames"] = [
        MAVLINK.enums["MAV_FRAME"][fields[name]].name for name in ("frame_id", "child_frame_id")
    ]
    # JSON has no word for what is not a number.
    is_unknown = math.isnan(fields["velocity_covariance"][0])
    fields["velocity_covariance"] = None if is_unknown else "known"
    print(json.dumps(fields))
