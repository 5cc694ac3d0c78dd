"""Sends a radar's beams as beam-udp (../beam-udp.md), format 2: python3 sender.py 127.0.0.1 6320

Put your radar in place of measure()."""

import socket
import struct
import sys
import time

BEAMS = 220
HEADER = struct.Struct("<4sBBHIIHHBBHHHIQIi")
RESOLUTION_UM = 16100


def make_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


TABLE = make_table()


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = (crc >> 8) ^ TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


def measure(beam, due):
    """A wall at 4.83 m all around, in place of a radar. Blocks until the beam is measured; gives (bin, dB)."""
    time.sleep(max(0.0, due - time.monotonic()))
    return [(300, 25.0)]


def datagram(sweep, beam, returns):
    values = b"".join(struct.pack("<Hh", bin, round(10 * power)) for bin, power in returns)
    header = HEADER.pack(
        b"RBM1", 1, 2, HEADER.size, 1, sweep, beam, BEAMS, 0, 1, len(returns), 0, 0,
        (beam << 32) // BEAMS, time.monotonic_ns(), RESOLUTION_UM, 0,
    )
    return header + values + struct.pack("<I", crc32c(header + values))


def main():
    to = (sys.argv[1], int(sys.argv[2]))
    sweeps = int(sys.argv[3]) if len(sys.argv) > 3 else 2**32
    out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    begin = time.monotonic()
    for number in range(sweeps * BEAMS):
        sweep, beam = divmod(number, BEAMS)
        returns = measure(beam, begin + 0.2 * number / BEAMS)
        out.sendto(datagram(sweep, beam, returns), to)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
