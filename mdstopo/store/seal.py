"""What is done to the bytes of a result file after HDF5 has made them: a right superblock, and a seal behind them.

HDF5's own checksums leave out texts of variable length, and some damages it does not survive: it hangs or crashes. So a
file ends in a seal of ours, behind what HDF5 looks at: the attributes of its groups as JSON, then 32 bytes with a mark,
the length of HDF5's part, that of the JSON, and the checksum of both. Attributes are read from there, as HDF5 keeps
theirs as texts of variable length. A file that another program has changed has lost its seal (HDF5 cuts it to its own
length) and is read without.
"""

import os
import struct
import zlib
from typing import BinaryIO, NamedTuple

_MARK = b"mdstopo\x01"
_TRAILER = struct.Struct("<8sQQQ")
#: superblock of versions 2 and 3 with addresses of eight bytes: where its flags, the end of the file, its checksum are
_VERSIONS, _ADDRESS, _FLAGS, _END, _CHECKSUM = (2, 3), 8, 11, 28, 44
_WORD = 0xFFFFFFFF
_PIECE = 1 << 20


class Seal(NamedTuple):
    """The seal of a file. whole: whether the file is as it was written, None where nothing tells; head: its JSON, empty
    without a seal."""

    whole: bool | None
    head: bytes


def seal(image: bytes, head: bytes) -> bytes:
    """The bytes of HDF5 as they belong on the disk, with `head` behind them."""
    body = right_superblock(image) + head
    return body + _TRAILER.pack(_MARK, len(image), len(head), zlib.crc32(body))


def read_seal(stream: BinaryIO) -> Seal:
    """The seal of a file, checked; of one without, whether it ends where HDF5 says."""
    size = stream.seek(0, os.SEEK_END)
    length = max(size - _TRAILER.size, 0)
    stream.seek(length)
    mark, image, head, checksum = _TRAILER.unpack(stream.read(_TRAILER.size).rjust(_TRAILER.size, b"\0"))
    if mark != _MARK:
        return Seal(_ends_as_told(stream, size), b"")
    if image + head != length or _checksum(stream, length) != checksum:
        return Seal(False, b"")
    stream.seek(image)
    return Seal(True, stream.read(head))


def _checksum(stream: BinaryIO, length: int) -> int:
    """The checksum of so many bytes from the start."""
    stream.seek(0)
    found = 0
    while length > 0:
        piece = stream.read(min(length, _PIECE))
        if not piece:  # cut off meanwhile
            return -1
        found = zlib.crc32(piece, found)
        length -= len(piece)
    return found


def _ends_as_told(stream: BinaryIO, size: int) -> bool | None:
    """Whether a file without a checksum is as long as its superblock says."""
    stream.seek(0)
    start = stream.read(_CHECKSUM)
    if len(start) < _CHECKSUM or start[8] not in _VERSIONS or start[9] != _ADDRESS:
        return None
    return bool(struct.unpack_from("<Q", start, _END)[0] == size)


def right_superblock(image: bytes) -> bytes:
    """The same with the checksum that belongs to the superblock.

    HDF5 before 2.0 (h5py before 3.16) gives the image of a file that is open for writing: it clears the flag that says
    so, but leaves the checksum that was made with the flag set, and then refuses to open the file.
    """
    if image[8] not in _VERSIONS or image[9] != _ADDRESS:
        return image
    start = image[:_FLAGS] + b"\0" + image[_FLAGS + 1 : _CHECKSUM]
    return start + struct.pack("<I", lookup3(start)) + image[_CHECKSUM + 4 :]


def lookup3(data: bytes) -> int:
    """The checksum that HDF5 gives its metadata: Bob Jenkins' lookup3 (`hashlittle`, from 0)."""
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    blocks = [struct.unpack("<3I", data[k : k + 12].ljust(12, b"\0")) for k in range(0, len(data), 12)]
    for k, (x, y, z) in enumerate(blocks, start=1):
        a, b, c = (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD
        if k < len(blocks):
            for by in (4, 6, 8, 16, 19, 4):
                a, b, c = b, (c + b) & _WORD, ((a - c) & _WORD) ^ _turned(c, by)
        else:
            for by in (14, 11, 25, 16, 4, 14, 24):
                a, b, c = b, ((c ^ b) - _turned(b, by)) & _WORD, a
            c = b
    return c


def _turned(word: int, by: int) -> int:
    return (word << by | word >> (32 - by)) & _WORD
