"""A stand-in for your flow code: listens at a port and answers the questions of `exumob.coupling.remote`.

    python examples/external_flow/stand_in.py --port 5005 &
    python examples/external_flow/drive.py --port 5005

It uses nothing of exumob and nothing but numpy, as your own code would: replace `BoxFlow` by calls of yours. Its
"flow" is hydrostatics of five boxes, quadratic drag, and added mass, which makes the wrenches jump with the
acceleration as those of real water do, so that coupling schemes can be tried on it.
"""

import argparse
import json
import socket
import struct

import numpy as np


class BoxFlow:
    """Five boxes in a current. State: the velocities that the bodies had at the end of the last interval."""

    def __init__(self, vehicle, water):
        """Take the sizes of the boxes from the vehicle's description, depth and current from the water's."""
        hull, wheel = vehicle["hull"], vehicle["wheel"]
        tyre = [0.8 * wheel["diameter"], wheel["width"], wheel["diameter"]]  # nearly the volume of the cylinder
        self.sizes = np.array([[hull["length"], hull["width"], hull["height"]], tyre, tyre, tyre, tyre])
        middle = hull["ground_clearance"] + 0.5 * hull["height"] - hull["center_of_mass_height"]
        self.offsets = np.array([[hull["center_x"] - hull["center_of_mass_x"], 0.0, middle], *np.zeros((4, 3))])
        self.depth, self.density = water["depth"], water["density"]
        self.current = np.array(water["velocity"])
        self.added = np.array([0.1, 0.5, 1.5])  # over the displaced mass; in heave more than the hull's own mass

    def start(self, poses, time):
        """Begin with still bodies."""
        self.time, self.velocity = time, poses["velocity"].copy()

    def advance(self, time, poses):
        """Return the mean wrenches on the five boxes over the interval, body axes, shape (5, 6)."""
        interval, wrenches = time - self.time, np.zeros((5, 6))
        for n, (size, offset, rotation) in enumerate(zip(self.sizes, self.offsets, poses["rotation"], strict=True)):
            center = poses["position"][n] + rotation @ offset
            draught = np.clip(self.depth - (center[2] - 0.5 * size[2]), 0.0, size[2])
            displaced = self.density * size[0] * size[1] * draught
            relative_velocity = poses["velocity"][n] - self.current
            areas = np.array([size[1] * draught, size[0] * draught, 0.5 * size[0] * size[1]])
            along = rotation.T @ relative_velocity
            drag = -0.5 * self.density * areas * np.abs(along) * along
            change = rotation.T @ (poses["velocity"][n] - self.velocity[n]) / interval
            lift = rotation.T @ np.array([0.0, 0.0, 9.81 * displaced])
            lever = offset + rotation.T @ np.array([0.0, 0.0, 0.5 * (draught - size[2])])
            force = lift + drag - displaced * self.added * change
            wrenches[n] = [*force, *np.cross(lever, force)]
        self.time, self.velocity = time, poses["velocity"].copy()
        return wrenches

    def save(self):
        """Return all that the next advance depends on. A real code would write a restart file and return its name."""
        return {"time": self.time, "velocity": self.velocity.tolist()}

    def restore(self, state):
        """Go back to a saved state."""
        self.time, self.velocity = state["time"], np.array(state["velocity"])


def serve(connection):
    """Answer until told to stop."""
    flow = None
    while True:
        question = receive(connection)
        answer = {}
        try:
            if question["do"] == "start":
                flow = BoxFlow(question["vehicle"], question["water"])
                flow.start(arrays(question["poses"]), question["time"])
            elif question["do"] == "advance":
                wrenches = flow.advance(question["time"], arrays(question["poses"]))
                answer = {"loads": wrenches.tolist(), "report": {"iterations": 1}}
            elif question["do"] == "save":
                answer = {"state": flow.save()}
            elif question["do"] == "restore":
                flow.restore(question["state"])
            elif question["do"] != "stop":
                answer = {"error": f"{question['do']!r} is not known; see exumob/coupling/remote.py"}
        except Exception as error:
            answer = {"error": f"stand-in flow: {type(error).__name__}: {error}"}
        send(connection, answer)
        if question["do"] == "stop":
            return


def arrays(poses):
    """Turn the lists of a message into arrays."""
    return {name: np.array(values) for name, values in poses.items()}


def send(connection, message):
    """Write one message: four bytes of length, then JSON."""
    text = json.dumps(message).encode()
    connection.sendall(struct.pack(">I", len(text)) + text)


def receive(connection):
    """Read one message."""
    (length,) = struct.unpack(">I", read_bytes(connection, 4))
    return json.loads(read_bytes(connection, length))


def read_bytes(connection, count):
    """Read so many bytes, however they arrive."""
    parts = b""
    while len(parts) < count:
        part = connection.recv(count - len(parts))
        if not part:
            raise SystemExit("the vehicle has gone")
        parts += part
    return parts


def main():
    """Serve one run; port 0 takes any free one, which is printed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--port", type=int, default=5005)
    with socket.create_server(("localhost", parser.parse_args().port)) as server:
        print(f"listening at port {server.getsockname()[1]}", flush=True)
        connection, _ = server.accept()
        with connection:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            serve(connection)


if __name__ == "__main__":
    main()
