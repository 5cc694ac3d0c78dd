"""A bad radio between two network namespaces: two TUN devices and, between them, rate, delay, loss,
other order, breaks, as lines on standard input set them.

python3 radio.py PID_A PID_B: the processes whose namespaces it joins; 10.7.0.1 is at A, 10.7.0.2
at B. A line has some of rate=BYTES_PER_SECOND (0: none) delay=S loss=SHARE swap=SHARE down=0|1;
each is answered by a line with the bytes that have gone from A to B and from B to A so far.
"""

import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import time

LIBC = ctypes.CDLL(None, use_errno=True)
CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 1, 0x1000
# What waits in front of the radio at most: a second of it, as a modem's buffer, but some packets.
QUEUE_S, QUEUE_MIN = 1.0, 8000


def tun(pid, own, other):
    """A device in the namespace of a process."""
    with open(f"/proc/{pid}/ns/net") as namespace:
        if LIBC.setns(namespace.fileno(), CLONE_NEWNET) != 0:
            raise OSError(ctypes.get_errno(), "setns")
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", b"radio", IFF_TUN | IFF_NO_PI))
    for command in (
        f"ip addr add {own} peer {other} dev radio",
        "ip link set radio mtu 1400 up",
        "ip link set lo up",
    ):
        subprocess.run(command.split(), check=True)
    return device


class Way:
    """One direction."""

    def __init__(self):
        self.free = 0.0
        self.packets = []
        self.count = 0
        self.bytes = 0
        self.waiting = 0

    def push(self, packet, radio, now):
        rate = radio["rate"]
        if radio["down"] or radio["random"].random() < radio["loss"]:
            # It has taken its time on the air.
            if rate:
                self.free = max(self.free, now) + len(packet) / rate
            return
        if rate and (self.free - now) * rate > max(QUEUE_S * rate, QUEUE_MIN):
            return
        self.bytes += len(packet)
        self.free = max(self.free, now) + (len(packet) / rate if rate else 0.0)
        at = self.free + radio["delay"]
        if radio["random"].random() < radio["swap"]:
            at += 0.03
        self.count += 1
        heapq.heappush(self.packets, (at, self.count, packet))

    def pop(self, now):
        if self.packets and self.packets[0][0] <= now:
            return heapq.heappop(self.packets)[2]
        return None


def main():
    own = os.open("/proc/self/ns/net", os.O_RDONLY)
    a = tun(sys.argv[1], "10.7.0.1", "10.7.0.2")
    b = tun(sys.argv[2], "10.7.0.2", "10.7.0.1")
    LIBC.setns(own, CLONE_NEWNET)
    radio = {"rate": 0.0, "delay": 0.0, "loss": 0.0, "swap": 0.0, "down": 0}
    radio["random"] = random.Random(7)
    ways = {a: (Way(), b), b: (Way(), a)}
    print("there", flush=True)
    text = b""
    while True:
        now = time.monotonic()
        nexts = [way.packets[0][0] for way, _ in ways.values() if way.packets]
        pause = max(0.0, min(nexts) - now) if nexts else 1.0
        ready, _, _ = select.select([a, b, 0], [], [], pause)
        now = time.monotonic()
        for device in (a, b):
            if device in ready:
                try:
                    ways[device][0].push(os.read(device, 65536), radio, now)
                except BlockingIOError:
                    pass
            way, other = ways[device]
            while (packet := way.pop(now)) is not None:
                if not radio["down"]:
                    os.write(other, packet)
        if 0 in ready:
            got = os.read(0, 65536)
            if not got:
                return
            text += got
            *lines, text = text.split(b"\n")
            for line in lines:
                for word in line.decode().split():
                    name, value = word.split("=")
                    radio[name] = float(value)
                print(ways[a][0].bytes, ways[b][0].bytes, flush=True)


main()
