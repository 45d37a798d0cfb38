"""The Meshcat server listens where it should, and says clearly when it cannot."""

import socket
from pathlib import Path

import pytest

from prehensile.errors import InputError
from prehensile.viz.meshcat import start_meshcat


def _listening(port: int) -> set[str]:
    """Local IPv4 and IPv6 addresses (hexadecimal, as in /proc) that listen on a port."""
    found = set()
    for table in ("/proc/net/tcp", "/proc/net/tcp6"):
        for row in Path(table).read_text().splitlines()[1:]:
            fields = row.split()
            address, its_port = fields[1].split(":")
            if fields[3] == "0A" and int(its_port, 16) == port:
                found.add(address)
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="needs Linux's /proc/net/tcp")
def test_listens_on_loopback_only() -> None:
    meshcat = start_meshcat()
    # 127.0.0.1 in the kernel's little-endian notation, or ::1.
    loopback = {"0100007F", "00000000000000000000000001000000"}
    addresses = _listening(meshcat.port())
    assert addresses
    assert addresses <= loopback


def test_two_servers_take_two_ports() -> None:
    first, second = start_meshcat(), start_meshcat()
    assert first.port() != second.port()
    for meshcat in (first, second):
        with socket.create_connection(("localhost", meshcat.port()), timeout=5) as connection:
            connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
            assert connection.recv(64).startswith(b"HTTP/1.1 200")


def test_taken_port_is_a_clear_error() -> None:
    taken = start_meshcat()
    with pytest.raises(InputError, match=f"port {taken.port()} is taken"):
        start_meshcat(port=taken.port())


@pytest.mark.parametrize("port", [0, -1, 80, 65536, 80000])
def test_impossible_port_is_a_clear_error(port: int) -> None:
    with pytest.raises(InputError, match=f"{port} is not a TCP port"):
        start_meshcat(port=port)


def test_explicit_port_is_used() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    assert start_meshcat(port=port).port() == port
