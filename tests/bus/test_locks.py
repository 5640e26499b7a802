"""Zenoh's locks and the interpreter's: no call may hold the one while it waits for the other."""

from __future__ import annotations

import subprocess
import sys

from tests.support.processes import free_endpoint

# Liveliness tokens come and go; a roll asks for them, whose answers come with a lock of Zenoh's
# held; meanwhile a latched publisher forgets. Ends by itself unless all of it stands still.
FORGETTING = """
import os, sys, threading, time
from fasaco_edge.bus.session import open_bus
from fasaco_edge.bus.settings import BusSettings
from fasaco_edge.wire import topics

endpoint = sys.argv[1]
bus = open_bus(BusSettings(mode="peer", connect=(), listen=(endpoint,)))
other = open_bus(BusSettings(mode="client", connect=(endpoint,)))
publisher = bus.publisher("path", "", topics.PATH.qos)
other.subscribe("path", lambda sample: None, latched=True)

def come_and_go():
    while True:
        other.withdraw(other.token("token/1"))

def ask():
    roll = bus.token_list("token/*")
    while True:
        roll.ask(0.0)
        time.sleep(0.001)

for work in (come_and_go, ask):
    threading.Thread(target=work, daemon=True).start()
for _ in range(2_000):
    publisher.put(b"x")
    publisher.forget()
print("forgot", flush=True)
os._exit(0)
"""


def test_a_publisher_closes_while_zenoh_waits_for_the_gil():
    command = [sys.executable, "-c", FORGETTING, free_endpoint()]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert ended.stdout == "forgot\n", ended.stderr
