"""A page is served where it says, or one line tells why not: it never waits for ever."""

from __future__ import annotations

import socket
import urllib.request
from collections.abc import Iterator

import pytest

pytest.importorskip("viser", reason="needs mute[web]")

from mute.live.page_server import page_address, page_server
from mute.support.errors import MuteError


@pytest.fixture
def taken() -> Iterator[int]:
    """Yield a port that another program listens at."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_page_is_served_where_it_says(taken):
    with page_server("127.0.0.1", taken) as server:
        address = page_address("127.0.0.1", server.get_port())
        with urllib.request.urlopen(address, timeout=20.0) as answer:
            assert answer.status == 200
            assert b"<html" in answer.read().lower()


def test_where_another_program_listens_the_next_port_is_taken(taken):
    with page_server("127.0.0.1", taken) as server:
        assert taken < server.get_port() < taken + 100


def test_a_page_that_is_over_leaves_its_port(taken):
    with page_server("127.0.0.1", taken) as server:
        port = server.get_port()
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", port))
        other.listen()


@pytest.mark.timeout(60)
@pytest.mark.parametrize("host", ["192.0.2.1", "no.such.host.invalid", "a" * 70, "a b"])
def test_a_host_that_is_not_this_machine_is_told_at_once(host):
    with (
        pytest.raises(MuteError, match=rf"no page at --host '{host}' --port 18090: \w+") as caught,
        page_server(host, 18090),
    ):
        pass
    assert "\n" not in str(caught.value)


@pytest.mark.timeout(60)
def test_the_last_port_that_is_taken_is_told_at_once():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 65535))
        other.listen()
        with (
            pytest.raises(MuteError, match="--port 65535: it and all after it are taken"),
            page_server("127.0.0.1", 65535),
        ):
            pass


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("127.0.0.1", "http://127.0.0.1:8080"),
        ("robot.example", "http://robot.example:8080"),
        ("0.0.0.0", "http://localhost:8080"),
        ("::", "http://localhost:8080"),
        ("::1", "http://[::1]:8080"),
    ],
)
def test_the_address_is_one_that_a_browser_can_open(host, address):
    assert page_address(host, 8080) == address
