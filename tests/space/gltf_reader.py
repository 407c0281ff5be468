"""Reads binary glTF files and holds them to the specification (glTF 2.0), as far as the project writes it."""

import json
import struct

import numpy as np

SIZES = {5125: 4, 5126: 4}
TYPES = {5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


class Gltf:
    """json: the document; numbers(i): the values of an accessor."""

    def __init__(self, data: bytes) -> None:
        magic, version, length = struct.unpack_from("<III", data)
        assert (magic, version, length) == (0x46546C67, 2, len(data))
        size, kind = struct.unpack_from("<II", data, 12)
        assert kind == 0x4E4F534A
        assert size % 4 == 0
        self.json = json.loads(data[20 : 20 + size])
        binary, kind = struct.unpack_from("<II", data, 20 + size)
        assert kind == 0x004E4942
        assert binary % 4 == 0
        self.data = data[28 + size :]
        assert len(self.data) == binary == self.json["buffers"][0]["byteLength"]
        assert self.json["asset"]["version"] == "2.0"
        self._views()
        self._meshes()
        self._tree()
        self._animations()

    def numbers(self, index):
        entry = self.json["accessors"][index]
        view = self.json["bufferViews"][entry["bufferView"]]
        width = WIDTHS[entry["type"]]
        found = np.frombuffer(
            self.data, TYPES[entry["componentType"]], entry["count"] * width, view["byteOffset"]
        ).reshape(entry["count"], width)
        return found[:, 0] if width == 1 else found

    def _views(self) -> None:
        end = 0
        for view in self.json["bufferViews"]:
            assert view["byteOffset"] % 4 == 0
            assert view["byteOffset"] >= end
            end = view["byteOffset"] + view["byteLength"]
        assert end <= len(self.data)
        for index, entry in enumerate(self.json["accessors"]):
            view = self.json["bufferViews"][entry["bufferView"]]
            assert entry["count"] >= 1
            assert entry["count"] * WIDTHS[entry["type"]] * SIZES[entry["componentType"]] == view["byteLength"]
            values = self.numbers(index)
            assert np.isfinite(values).all()
            if "min" in entry:
                assert np.array_equal(np.atleast_1d(values.min(axis=0)), np.float32(entry["min"]))
                assert np.array_equal(np.atleast_1d(values.max(axis=0)), np.float32(entry["max"]))

    def _meshes(self) -> None:
        for mesh in self.json.get("meshes", []):
            assert mesh["primitives"]
            for part in mesh["primitives"]:
                place = self.json["accessors"][part["attributes"]["POSITION"]]
                assert place["type"] == "VEC3"
                assert "min" in place
                assert "max" in place
                assert part["material"] < len(self.json["materials"])
                for index in part["attributes"].values():
                    assert self.json["accessors"][index]["count"] == place["count"]
                    assert self.json["bufferViews"][self.json["accessors"][index]["bufferView"]]["target"] == 34962
                if "NORMAL" in part["attributes"]:
                    normals = self.numbers(part["attributes"]["NORMAL"])
                    assert np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() < 1e-6
                if "indices" in part:
                    order = self.numbers(part["indices"])
                    assert self.json["accessors"][part["indices"]]["componentType"] == 5125
                    assert order.max() < place["count"]
                    assert len(order) % {1: 2, 4: 3}[part["mode"]] == 0

    def _tree(self) -> None:
        nodes = self.json["nodes"]
        children = [child for node in nodes for child in node.get("children", [])]
        roots = self.json["scenes"][self.json["scene"]]["nodes"]
        assert sorted(children + roots) == list(range(len(nodes)))  # each node once: trees
        for node in nodes:
            if "rotation" in node:
                assert abs(np.linalg.norm(node["rotation"]) - 1.0) < 1e-6
            assert node.get("children", [0])
            assert node.get("mesh", 0) < len(self.json.get("meshes", [0]))

    def _animations(self) -> None:
        for animation in self.json.get("animations", []):
            targets = [(each["target"]["node"], each["target"]["path"]) for each in animation["channels"]]
            assert len(set(targets)) == len(targets)
            for channel in animation["channels"]:
                sampler = animation["samplers"][channel["sampler"]]
                times, values = self.numbers(sampler["input"]), self.numbers(sampler["output"])
                entry = self.json["accessors"][sampler["input"]]
                assert (entry["type"], entry["componentType"]) == ("SCALAR", 5126)
                assert "min" in entry
                assert "max" in entry
                assert times[0] >= 0.0
                assert (np.diff(times) > 0.0).all()
                assert sampler["interpolation"] == "LINEAR"
                assert len(values) == len(times)
                path = channel["target"]["path"]
                assert values.shape[1] == {"translation": 3, "rotation": 4, "scale": 3}[path]
                if path == "rotation":
                    assert np.abs(np.linalg.norm(values, axis=1) - 1.0).max() < 1e-6
                    assert (np.einsum("tk,tk->t", values[1:], values[:-1]) >= 0.0).all()

    def track(self, animation: int, node: int, path: str):
        """Times and values of what is animated."""
        found = self.json["animations"][animation]
        for channel in found["channels"]:
            if channel["target"] == {"node": node, "path": path}:
                sampler = found["samplers"][channel["sampler"]]
                return self.numbers(sampler["input"]), self.numbers(sampler["output"])
        raise KeyError(path)

    def node(self, name: str) -> int:
        """The index of the node of that name."""
        return next(k for k, node in enumerate(self.json["nodes"]) if node.get("name") == name)
