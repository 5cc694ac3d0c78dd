"""Reads every IMU sample of a running pipeline; prints how many came and how many it missed."""

import argparse

from randt_bus import Bus

arguments = argparse.ArgumentParser()
arguments.add_argument("--prefix")
arguments.add_argument("--run")
arguments = arguments.parse_args()

count = missed = 0
last = None
for message in Bus(arguments.prefix, arguments.run).subscribe("imu/sample/v1"):
    header = message.head["header"]
    epoch, sequence = int(header["epoch"]), int(header["sequence"])
    if last is not None and last[0] == epoch:
        missed += sequence - last[1] - 1
    last = (epoch, sequence)
    count += 1
    if count % 250 == 0:
        print(count, missed, flush=True)
