# SPDX-License-Identifier: Apache-2.0
"""A stand-in for rclpy that publishers run on."""

import signal
import types

START_S = 1_700_000_000  # of its clock, since the Unix epoch


class StandIn:
    """As much of rclpy as a publisher needs; its clock runs a tick at a time."""

    def __init__(self, monkeypatch, stop_after=10**9, listens_at_s=0.0, **parameters):
        self.said, self.stamps_s, self.now_s, self.stop_after = [], [], 0.0, stop_after
        self.listens_at_s = listens_at_s
        stand_in = self

        class Node:
            def __init__(self, name):
                pass

            def declare_parameter(self, name, value):
                return types.SimpleNamespace(value=parameters.get(name, value))

            def get_clock(self):
                stamp = types.SimpleNamespace(to_msg=lambda: START_S + stand_in.now_s)
                return types.SimpleNamespace(now=lambda: stamp)

            def create_publisher(self, kind, topic, depth):
                return types.SimpleNamespace(
                    publish=stand_in.hear,
                    topic_name=f"/{topic}",
                    get_subscription_count=lambda: int(stand_in.now_s >= stand_in.listens_at_s),
                )

            def create_timer(self, period_s, call):
                stand_in.period_s, stand_in.call = period_s, call

            def destroy_node(self):
                pass

        def vector():
            return types.SimpleNamespace(x=0.0, y=0.0, z=0.0)

        def twist():
            return types.SimpleNamespace(linear=vector(), angular=vector())

        def twist_stamped():
            return types.SimpleNamespace(header=types.SimpleNamespace(stamp=0), twist=twist())

        rclpy = types.ModuleType("rclpy")
        rclpy.init, rclpy.spin = lambda **_: None, self.spin
        rclpy.shutdown = lambda: None
        modules = {
            "rclpy": rclpy,
            "rclpy.node": types.SimpleNamespace(Node=Node),
            "rclpy.signals": types.SimpleNamespace(
                SignalHandlerOptions=types.SimpleNamespace(NO=0)
            ),
            "geometry_msgs": types.ModuleType("geometry_msgs"),
            "geometry_msgs.msg": types.SimpleNamespace(Twist=twist, TwistStamped=twist_stamped),
        }
        for name, module in modules.items():
            monkeypatch.setitem(__import__("sys").modules, name, module)

    def hear(self, message):
        twist = getattr(message, "twist", message)
        if twist is not message:
            self.stamps_s.append(message.header.stamp - START_S)
        self.said.append((self.now_s, twist.linear.x, twist.linear.y, twist.angular.z))

    def spin(self, node):
        while True:
            self.now_s += self.period_s
            if self.now_s > self.stop_after:
                raise KeyboardInterrupt
            self.call()

    def run(self, path, monkeypatch):
        """The program, on this clock; what it does to signals is undone."""
        monkeypatch.setattr("time.monotonic", lambda: self.now_s)
        monkeypatch.setattr("time.time", lambda: START_S + self.now_s)
        monkeypatch.setattr("sys.argv", [str(path)])
        monkeypatch.setattr("time.sleep", lambda _: None)
        before = signal.getsignal(signal.SIGTERM)
        try:
            exec(compile(path.read_text(), path, "exec"), {"__name__": "__main__"})
        finally:
            signal.signal(signal.SIGTERM, before)
