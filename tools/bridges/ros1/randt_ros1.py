"""ROS 1's side of randt-ros1, which starts it with a node's name and the topics to subscribe to:
these go to the standard output, and messages from the standard input to topics of ROS. A node ends
when its master does, and is started anew.

A frame, both ways, little-endian: the length of what follows (u32), flags (u8: 1 latched, 2 an
announcement of a topic whose messages are to come, or of the node itself), topic and type (each a
length, u8, and UTF-8), nanoseconds (i64: when it came, or its stamp), and the message as ROS 1
serialises it.
"""

import os
import signal
import struct
import sys
import threading
import time
import traceback

import rosgraph
import rospy
from roslib.message import get_message_class

NAME = "/" + sys.argv[1]
# A sweep of 10,000 returns has 200 kB.
BUFFER_BYTES = 1 << 24
WATCH_S = 0.5

frames_out = os.fdopen(os.dup(1), "wb")
# What ROS prints is for people.
os.dup2(2, 1)
lock = threading.Lock()
# Whether there is a master.
is_ready = threading.Event()


def send(flags, topic, type_name, arrival_ns, data):
    """Writes a frame; where nobody reads any more the node ends."""
    head = struct.pack("<B", flags)
    for text in (topic.encode(), type_name.encode()):
        head += struct.pack("<B", len(text)) + text
    head += struct.pack("<q", arrival_ns)
    try:
        with lock:
            frames_out.write(struct.pack("<I", len(head) + len(data)) + head + data)
            frames_out.flush()
    except OSError:
        os._exit(0)


def forward(topic):
    """Subscribes to whatever type a topic has."""

    def callback(message):
        header = message._connection_header
        # What this node publishes comes back to it.
        if header.get("callerid") != NAME:
            send(0, topic, header["type"], time.time_ns(), message._buff)

    rospy.Subscriber(topic, rospy.AnyMsg, callback, buff_size=BUFFER_BYTES, tcp_nodelay=True)


def read(stream, count):
    """Exactly that many bytes; the node ends with its stream."""
    data = stream.read(count)
    if len(data) < count:
        os._exit(0)
    return data


def publish(stream):
    """Publishes what comes, each topic from its first message on. Without a master what is latched
    is kept."""
    publishers, waiting = {}, []
    while True:
        (length,) = struct.unpack("<I", read(stream, 4))
        frame = read(stream, length)
        flags, at, texts = frame[0], 1, []
        for _ in range(2):
            end = at + 1 + frame[at]
            texts.append(frame[at + 1 : end].decode())
            at = end
        topic, type_name = texts
        if flags or is_ready.is_set():
            waiting.append((topic, type_name, flags, frame[at + 8 :]))
        if not is_ready.is_set():
            continue
        for topic, type_name, flags, data in waiting:
            kind = get_message_class(type_name)
            if kind is None:
                rospy.logerr_once("no type %s: its package is not installed", type_name)
                continue
            if topic not in publishers:
                publishers[topic] = rospy.Publisher(topic, kind, latch=flags & 1, queue_size=50)
            if flags & 2:
                continue
            message = kind()
            message.deserialize(data)
            publishers[topic].publish(message)
        waiting.clear()


def end(failure):
    """Half a node is none: it says why and is started anew."""
    traceback.print_exception(failure.exc_type, failure.exc_value, failure.exc_traceback)
    os._exit(4)


def watch():
    """A master that has gone, or was started anew, does not know this node."""
    master, known = rosgraph.Master(NAME), None
    while True:
        time.sleep(WATCH_S)
        try:
            pid = master.getPid()
        except Exception:
            pid = None
        if known is not None and pid != known:
            os._exit(3)
        known = pid or known


def main():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.excepthook = end
    # Also while it waits for its master.
    threading.Thread(target=publish, args=(sys.stdin.buffer,), daemon=True).start()
    rospy.init_node(NAME[1:], argv=[], disable_signals=True)
    is_ready.set()
    threading.Thread(target=watch, daemon=True).start()
    for topic in sys.argv[2:]:
        forward(topic)
    send(2, "", "", time.time_ns(), b"")
    rospy.spin()
    # Another node has taken the name.
    os._exit(3)


main()
