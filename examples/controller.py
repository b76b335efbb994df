#!/usr/bin/env python3
"""A controller for mtj in another language: docs/wire.md at work, over Zenoh.

It needs Python 3.11 and `pip install eclipse-zenoh`, and takes the place of `mtj controller`:

    mtj plant --listen tcp/127.0.0.1:7447 --scenario sampled/mtj --set timing.clock=lockstep
    python3 examples/controller.py --connect tcp/127.0.0.1:7447

Laws tj and mtj for a planar arm on a circle, with every memory policy; what else a scenario may ask for, it says
it cannot do.
"""

import argparse
import json
import math
import secrets
import struct
import sys
import time
import tomllib

import zenoh

VERSION = 3
# Header: version, joints, axes, revision, run, sequence, time_ns. Then what each sample has of its own.
STATE = struct.Struct("<4I3Q 6Q 7d 7d 6d 6d")  # sent_ns …, leader, timed_out, position, velocity, applied, delivered
TORQUE = struct.Struct("<4I3Q 3Q 7d 6d")  # state_sent_ns, residence_ns, controller, torque, force
UNITS = {"ns": 1, "us": 1e3, "µs": 1e3, "ms": 1e6, "s": 1e9, "min": 60e9, "h": 3600e9, "d": 86400e9}


def nanoseconds(text):
    """A duration like "10 ms"."""
    number = text.strip().rstrip("nsumµihd")
    return round(float(number) * UNITS[text.strip()[len(number):].strip()])


class Law:
    """A scenario's task force and torque: Q = Kp e + Kd ė + k h and τ = Jᵀ Q."""

    def __init__(self, scenario):
        law, path = scenario["law"], scenario["trajectory"]
        self.factor = {"kind": "exponential", "error": 1.0, "error_rate": 10.0, "ceiling": 1.0} | law.get("factor", {})
        self.memory = {"policy": "sent", "step": scenario["timing"]["sample_period"]} | law.get("memory", {})
        if (law["kind"] not in ("tj", "mtj") or "prediction" in law or law.get("acceleration")
                or path["kind"] == "point-to-point" or not {"switch", "exponential"} & {self.factor["kind"]}
                or not all(isinstance(law[gain], (int, float)) for gain in ("kp", "kd"))):
            sys.exit("controller.py: this scenario asks for a law or a path that this example does not know")
        self.lengths = [link["length"] for link in scenario["arm"]["links"]]
        self.kp, self.kd, self.remembers = law["kp"], law["kd"], law["kind"] == "mtj"
        self.path = {"center": [0, 0], "phase": 0, "ripple": {"amplitude": 0, "multiple": 0}} | path
        self.step_ns = nanoseconds(self.memory["step"])
        self.forget()

    def forget(self):
        self.is_first, self.step, self.sent = True, None, (0.0, 0.0)

    def desired(self, t):
        """Where the tip should be at t, and how fast it should move."""
        w, r, ripple = self.path["angular_frequency"], self.path["radius"], self.path["ripple"]
        angle, rate, size = w * t + self.path["phase"], ripple["multiple"] * w, ripple["amplitude"]
        spoke, swing = (r * math.cos(angle), r * math.sin(angle)), size * math.sin(rate * t)
        where = [c + s + swing for c, s in zip(self.path["center"], spoke)]
        return where, [v + size * rate * math.cos(rate * t) for v in (-w * spoke[1], w * spoke[0])]

    def jacobian(self, q):
        """Tip position, and one column (∂x/∂qᵢ, ∂y/∂qᵢ) for each joint."""
        angle, links = 0.0, []
        for length, joint in zip(self.lengths, q):
            angle += joint
            links.append((length * math.cos(angle), length * math.sin(angle)))
        beyond = [[sum(axis) for axis in zip(*links[i:])] for i in range(len(links))]
        return beyond[0], [(-y, x) for x, y in beyond]

    def regulate(self, e, e_rate):
        """k, eq. (14) or (15a)."""
        error, error_rate = math.hypot(*e) / self.factor["error"], math.hypot(*e_rate) / self.factor["error_rate"]
        is_switch = self.factor["kind"] == "switch"
        k = float(error < 1 and error_rate < 1) if is_switch else math.exp(-(error + error_rate))
        return k * self.factor["ceiling"]

    def respond(self, time_ns, position, velocity, applied, delivered):
        """The torque and the task force for one state."""
        tip, columns = self.jacobian(position)
        speed = [sum(column[axis] * v for column, v in zip(columns, velocity)) for axis in (0, 1)]
        where, how_fast = self.desired(time_ns * 1e-9)
        e, e_rate = [d - x for d, x in zip(where, tip)], [d - v for d, v in zip(how_fast, speed)]
        force = [self.kp * x + self.kd * v for x, v in zip(e, e_rate)]
        if self.remembers and not self.is_first:
            k = self.regulate(e, e_rate)
            memory = {"sent": self.sent, "applied": applied, "delivered": delivered}[self.memory["policy"]]
            force = [f + k * h for f, h in zip(force, memory)]
        self.is_first = False
        if self.step != time_ns // self.step_ns:  # The first task force in a memory step serves until the next.
            self.step, self.sent = time_ns // self.step_ns, force
        return [column[0] * force[0] + column[1] * force[1] for column in columns], force


def fetch(session, key):
    """The scenario that the plant offers: (run, revision) and the law; None if there is none to be had."""
    for reply in session.get(key):
        if reply.ok is None:
            continue
        data = reply.ok.payload.to_bytes()
        version, revision, run, name = struct.unpack_from("<IIQQ", data)
        (length,) = struct.unpack_from("<Q", data, 24 + name)
        if version == VERSION:
            return (run, revision), Law(tomllib.loads(data[32 + name:32 + name + length].decode()))
    return None


def padded(numbers, count):
    return [*numbers, *[0.0] * (count - len(numbers))]


def serve(session, name):
    """Answers states as long as the process lives."""
    key, me = f"mtj/{name}", secrets.randbelow(2**64 - 1) + 1
    states = session.declare_subscriber(f"{key}/state", zenoh.handlers.RingChannel(1))
    torques = session.declare_publisher(f"{key}/torque", express=True, priority=zenoh.Priority.REAL_TIME,
                                        congestion_control=zenoh.CongestionControl.DROP)
    # Who is announced can be put in charge, and stands by for others until then.
    token = session.liveliness().declare_token(f"{key}/member/controller/{me}/0/{time.time_ns()}")
    known, law, answered, answer = None, None, None, None
    for sample in states:
        received, data = time.perf_counter_ns(), sample.payload.to_bytes()
        if len(data) != STATE.size:
            continue
        fields = STATE.unpack(data)
        version, joints, axes, revision, run, sequence, time_ns, sent_ns, _, _, _, leader, timed_out = fields[:13]
        if version != VERSION or not all(map(math.isfinite, fields[13:])):
            continue
        if known is None or known[0] != run or known[1] < revision:  # Another plant, or a knob was turned.
            offer = fetch(session, f"{key}/scenario")
            if offer is None or offer[0][0] != run or offer[0][1] < revision:
                continue
            if known is not None and known[0] == run:  # What is remembered goes only with the plant.
                offer[1].is_first, offer[1].step, offer[1].sent = law.is_first, law.step, law.sent
            known, law = offer
        if answered != (run, sequence):  # One that comes again is answered as before.
            if timed_out:
                law.forget()
            position, velocity, applied, delivered = fields[13:20], fields[20:27], fields[27:33], fields[33:39]
            answer = law.respond(time_ns, position[:joints], velocity[:joints], applied[:axes], delivered[:axes])
            answered = run, sequence
        if leader in (0, me):
            header = VERSION, joints, axes, revision, run, sequence, time_ns
            residence = time.perf_counter_ns() - received
            torques.put(TORQUE.pack(*header, sent_ns, residence, me, *padded(answer[0], 7), *padded(answer[1], 6)))
    token.undeclare()


def main():
    options = argparse.ArgumentParser(description="A controller for mtj in another language, over Zenoh")
    options.add_argument("--connect", default="tcp/127.0.0.1:7447", metavar="ENDPOINT", help="where the plant listens")
    options.add_argument("--session", default="default", metavar="NAME")
    options = options.parse_args()
    config = zenoh.Config()
    for key, value in (("mode", "client"), ("connect/endpoints", [options.connect]), ("connect/timeout_ms", -1),
                       ("scouting/multicast/enabled", False), ("scouting/gossip/enabled", False)):
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        try:
            serve(session, options.session)
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
