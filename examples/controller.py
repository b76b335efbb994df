#!/usr/bin/env python3
"""A controller for mtj in another language: docs/wire.md at work, over Zenoh.

It needs Python 3.11 and `pip install eclipse-zenoh`, and takes the place of `mtj controller`:

    mtj plant --listen tcp/127.0.0.1:7447 --scenario sampled/mtj --set timing.clock=lockstep
    python3 examples/controller.py --connect tcp/127.0.0.1:7447

It has the laws tj and mtj for a planar arm on a circle, with every memory policy and the term of eq. (11). It
refuses scenarios that ask for anything else.
"""

import argparse
import itertools
import json
import math
import secrets
import struct
import sys
import time
import tomllib
import types

import zenoh

VERSION = 5


class Layout:
    """A sample as bytes: the names of its fields in order, each with its format."""

    def __init__(self, fields):
        self.fields = [field.split(":") for field in fields.split()]
        self.struct = struct.Struct("<" + "".join(form for _, form in self.fields))
        self.size = self.struct.size

    def unpack(self, data):
        numbers, sample = iter(self.struct.unpack(data)), types.SimpleNamespace()
        for name, form in self.fields:
            count = form[:-1]
            setattr(sample, name, list(itertools.islice(numbers, int(count))) if count else next(numbers))
        return sample

    def pack(self, **values):
        """Lists that are shorter than their field are filled up with zeros."""
        numbers = []
        for name, form in self.fields:
            value, count = values[name], int(form[:-1] or 1)
            numbers += [*value, *[0.0] * (count - len(value))] if isinstance(value, list) else [value]
        return self.struct.pack(*numbers)


HEADER = "version:I joints:I axes:I revision:I run:Q sequence:Q time_ns:Q"
STATE = Layout(HEADER + """ sent_ns:Q latency_ns:Q round_trip_ns:Q residence_ns:Q leader:Q timed_out:Q echo_count:Q
    position:7d velocity:7d applied:7d delivered:7d""")
TORQUE = Layout(HEADER + """ state_sent_ns:Q residence_ns:Q controller:Q echo_count:Q torque:7d echo:7d""")
UNITS = {"ns": 1, "us": 1e3, "µs": 1e3, "ms": 1e6, "s": 1e9, "min": 60e9, "h": 3600e9, "d": 86400e9}


def nanoseconds(text):
    """A duration like "10 ms"."""
    number = text.strip().rstrip("nsumµihd")
    return round(float(number) * UNITS[text.strip()[len(number):].strip()])


class Law:
    """A scenario's task force and torque: Q = Kp e + Kd ė + h [+ ë, eq. (11)] and τ = Jᵀ Q."""

    def __init__(self, scenario):
        law, path = scenario["law"], scenario["trajectory"]
        self.factor = {"kind": "exponential", "error": 1.0, "error_rate": 10.0, "ceiling": 1.0} | law.get("factor", {})
        self.memory = {"policy": "sent", "step": scenario["timing"]["sample_period"]} | law.get("memory", {})
        if (law["kind"] not in ("tj", "mtj") or "prediction" in law
                or path["kind"] == "point-to-point" or not {"switch", "exponential"} & {self.factor["kind"]}
                or not all(isinstance(number, (int, float)) for number in (
                    law["kp"], law["kd"], self.factor["error"], self.factor["error_rate"]))
                or law.get("acceleration") and law.get("mass", 1) != 1):
            sys.exit("controller.py: this example does not know the scenario's law or path")
        self.lengths = [link["length"] for link in scenario["arm"]["links"]]
        self.kp, self.kd, self.remembers = law["kp"], law["kd"], law["kind"] == "mtj"
        self.accelerates = self.remembers and law.get("acceleration", False)
        self.path = {"center": [0, 0], "phase": 0, "ripple": {"amplitude": 0, "multiple": 0}} | path
        self.step_ns = nanoseconds(self.memory["step"])
        self.forget()

    def forget(self):
        self.is_first, self.step, self.sent, self.before = True, None, (0.0, 0.0), None

    def resume_from(self, other):
        self.is_first, self.step, self.sent, self.before = other.is_first, other.step, other.sent, other.before

    def desired(self, t):
        """The desired position, velocity and acceleration of the tip at t."""
        w, r, ripple = self.path["angular_frequency"], self.path["radius"], self.path["ripple"]
        angle, rate, size = w * t + self.path["phase"], ripple["multiple"] * w, ripple["amplitude"]
        spoke, swing = (r * math.cos(angle), r * math.sin(angle)), size * math.sin(rate * t)
        position = [c + s + swing for c, s in zip(self.path["center"], spoke)]
        velocity = [v + size * rate * math.cos(rate * t) for v in (-w * spoke[1], w * spoke[0])]
        return position, velocity, [-w * w * s - rate * rate * swing for s in spoke]

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

    def acceleration(self, t, speed):
        """The tip's acceleration since the last sample; zero at the first one."""
        (before, slower), self.before = self.before or (t, speed), (t, speed)
        return [(v - u) / (t - before) if t > before else 0.0 for v, u in zip(speed, slower)]

    def respond(self, time_ns, position, velocity, applied, delivered):
        """The torque and the task force for one state."""
        tip, columns = self.jacobian(position)
        speed = [sum(column[axis] * v for column, v in zip(columns, velocity)) for axis in (0, 1)]
        x_d, v_d, a_d = self.desired(time_ns * 1e-9)
        e, e_rate = [d - x for d, x in zip(x_d, tip)], [d - v for d, v in zip(v_d, speed)]
        force = [self.kp * x + self.kd * v for x, v in zip(e, e_rate)]
        acceleration = self.acceleration(time_ns * 1e-9, speed)
        if self.accelerates:
            force = [f + d - a for f, d, a in zip(force, a_d, acceleration)]
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


def serve(session, name):
    """Answers states as long as the process lives."""
    key, me = f"mtj/{name}", secrets.randbelow(2**64 - 1) + 1
    states = session.declare_subscriber(f"{key}/state", zenoh.handlers.RingChannel(1))
    torques = session.declare_publisher(f"{key}/torque", express=True, priority=zenoh.Priority.REAL_TIME,
                                        congestion_control=zenoh.CongestionControl.DROP)
    # An announced controller can be put in charge; until then it stands by.
    token = session.liveliness().declare_token(f"{key}/member/controller/{me}/0/{time.time_ns()}")
    known, law, answered = None, None, None
    for sample in states:
        received, data = time.perf_counter_ns(), sample.payload.to_bytes()
        if len(data) != STATE.size:
            continue
        state = STATE.unpack(data)
        vectors = state.position, state.velocity, state.applied, state.delivered
        if state.version != VERSION or not all(map(math.isfinite, itertools.chain(*vectors))):
            continue
        run, revision = state.run, state.revision
        if known is None or known[0] != run or known[1] < revision:  # Another plant, or a changed scenario.
            offer = fetch(session, f"{key}/scenario")
            if offer is None or offer[0][0] != run or offer[0][1] < revision:
                continue
            if known is not None and known[0] == run:  # What is remembered goes only with the plant.
                offer[1].resume_from(law)
            known, law = offer
        if answered != (run, state.sequence):  # A state that comes again is answered as before.
            if state.timed_out:
                law.forget()
            vectors = [v[:n] for v, n in zip(vectors, (state.joints, state.joints, state.axes, state.axes))]
            torque, echo = law.respond(state.time_ns, *vectors)
            answered = run, state.sequence
        if state.leader in (0, me):
            residence = time.perf_counter_ns() - received
            answer = vars(state) | {"state_sent_ns": state.sent_ns, "residence_ns": residence, "controller": me,
                                    "echo_count": len(echo), "torque": torque, "echo": echo}
            torques.put(TORQUE.pack(**answer))
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
