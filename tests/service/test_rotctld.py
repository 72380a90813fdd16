"""A simulated rotator behind rotctld's protocol, with all that goes wrong: the antenna ends where it is sent, or the
status says why not, and no command ever leaves the limits. Time is the test's."""

from __future__ import annotations

import contextlib
import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.pointing.mount import Mount, MountState
from boresight.service.rotctld import Rotator, off_target

DEG = math.pi / 180.0
STOPS = ((-270.0, 270.0), (0.0, 90.0))
MOUNT = Mount((-270 * DEG, 270 * DEG), (0.0, 90 * DEG), 10 * DEG, 10 * DEG)
BAND, PERIOD, TICK = 0.3, 0.5, 0.1


@dataclass
class Sim:
    """Answers `p` and `P` at simulated time; slews at `rate` (°/s) within stops of its own; keeps every command."""

    azimuth: float = 10.0
    elevation: float = 20.0
    rate: float = 8.0
    stops: tuple[float, float] = (-1e9, 1e9)  # where azimuth stays, whatever it answers
    turn: float = 0.0  # added to the azimuth it tells
    refuses: Callable[[int, float, float], int] = lambda n, az, el: 0
    garbles: Callable[[int, bytes], list[bytes]] = lambda n, answer: [answer]  # pieces; None in it: hangs up
    delay: float = 0.0
    hand: tuple[float, float, float, float] | None = None  # from when till when it is held at an azimuth, elevation
    commands: list[tuple[float, float]] = field(default_factory=list)
    answers: int = 0
    peers: int = 0

    def __post_init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.setblocking(False)
        self.port = self.server.getsockname()[1]
        self.peer: socket.socket | None = None
        self.buffer = b""
        self.goal: tuple[float, float] | None = None
        self.queue: list[tuple[float, bytes]] = []
        self.last = 0.0

    def serve(self, now: float) -> None:
        self._slew(now)
        if self.peer is None:
            with contextlib.suppress(BlockingIOError):
                self.peer, _ = self.server.accept()
                self.peer.setblocking(False)
                self.peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # simulated time does not wait
                self.buffer, self.queue, self.peers = b"", [], self.peers + 1
        if self.peer is None:
            return
        try:
            data = self.peer.recv(4096)
            if not data:
                self.hang_up()
                return
            self.buffer += data
        except BlockingIOError:
            pass
        except OSError:
            self.hang_up()
            return
        *lines, self.buffer = self.buffer.split(b"\n")
        for line in lines:
            answer = self._answer(line.decode().split())
            self.answers += 1
            self.queue += [(now + self.delay, piece) for piece in self.garbles(self.answers, answer)]
        while self.peer is not None and self.queue and self.queue[0][0] <= now + 1e-9:
            piece = self.queue.pop(0)[1]
            if piece is None:
                self.hang_up()
            else:
                with contextlib.suppress(OSError):
                    self.peer.sendall(piece)

    def hang_up(self) -> None:
        if self.peer is not None:
            self.peer.close()
        self.peer, self.queue = None, []

    def close(self) -> None:
        self.hang_up()
        self.server.close()

    def _answer(self, word: list[str]) -> bytes:
        if word[0] == "p":
            return f"{self.azimuth + self.turn:.4f}\n{self.elevation:.4f}\n".encode()
        az, el = float(word[1]), float(word[2])
        self.commands.append((az, el))
        code = self.refuses(len(self.commands), az, el)
        if code == 0:
            self.goal = (min(max(az, self.stops[0]), self.stops[1]), el)
        return f"RPRT {code}\n".encode()

    def _slew(self, now: float) -> None:
        dt, self.last = now - self.last, now
        if self.hand is not None and self.hand[0] <= now < self.hand[1]:
            self.azimuth, self.elevation = self.hand[2], self.hand[3]
            self.goal = None
        elif self.goal is not None:
            most = self.rate * dt
            self.azimuth += min(max(self.goal[0] - self.azimuth, -most), most)
            self.elevation += min(max(self.goal[1] - self.elevation, -most), most)


@pytest.fixture
def sims() -> Iterator[list[Sim]]:
    made: list[Sim] = []
    yield made
    for sim in made:
        sim.close()


def drive(
    sim: Sim, where: Callable[[float], tuple[float, float]], seconds: float, mount: Mount = MOUNT, begin: float = 0.0,
    rotator: Rotator | None = None,
) -> tuple[Rotator, float, list[str]]:  # fmt: skip
    """Follow a direction (deg) for so long; the rotator, how far (deg) the antenna is off at the end, all it told."""
    r = rotator or Rotator(f"127.0.0.1:{sim.port}", mount, BAND * DEG, PERIOD)
    told: list[str] = []
    for k in range(round(seconds / TICK)):
        now = begin + k * TICK
        az, el = where(now)
        sim.serve(now)
        r.follow(az * DEG, el * DEG, now)
        sim.serve(now)
        if r.socket is not None and not r.ready:
            time.sleep(0.001)
        said = r.told(now)
        if not told or told[-1] != said:
            told.append(said)
    az, el = where(begin + seconds)
    off = math.degrees(off_target(MountState(sim.azimuth * DEG, sim.elevation * DEG), az * DEG, el * DEG))
    stops = (np.degrees(mount.azimuth), np.degrees(mount.elevation))
    assert all(stops[0][0] <= a <= stops[0][1] and stops[1][0] <= e <= stops[1][1] for a, e in sim.commands)
    if rotator is None:
        r.close()
    return r, off, told


def still(azimuth: float, elevation: float) -> Callable[[float], tuple[float, float]]:
    return lambda t: (azimuth, elevation)


def test_it_goes_there(sims: list[Sim]) -> None:
    sims.append(sim := Sim())
    r, off, told = drive(sim, still(100.0, 45.0), 20.0)
    assert off < BAND
    assert told[-1] == "rotator on"
    assert r.counts["refused"] == r.counts["resent"] == r.counts["lost"] == 0


@pytest.mark.parametrize("numbers", [{1}, {1, 2, 3, 4, 5}, {10}, set(range(8, 22)), set(range(1, 90, 2))])
def test_a_refused_set_is_sent_again(sims: list[Sim], numbers: set[int]) -> None:
    """However many are refused, whichever: the last one too, after which nothing else would be sent."""
    sims.append(sim := Sim(refuses=lambda n, az, el: -6 if n in numbers else 0))
    r, off, told = drive(sim, still(60.0, 45.0), 60.0)
    assert off < BAND
    assert told[-1] == "rotator on"
    assert r.counts["refused"] >= min(len(numbers), 1)
    assert any("refuses" in t and "RPRT -6, input/output error" in t for t in told)


def test_what_it_always_refuses_is_told(sims: list[Sim]) -> None:
    sims.append(sim := Sim(refuses=lambda n, az, el: -1))
    r, off, told = drive(sim, still(60.0, 45.0), 30.0)
    assert off > 40.0
    assert told[-1].startswith("rotator refuses")
    assert "RPRT -1, invalid parameter" in told[-1]
    assert "stands at 10.0 20.0" in told[-1]
    assert r.summary(30.0)["rotator_off_deg"] > 40.0
    assert 10 <= r.counts["sent"] < 60  # it goes on trying, but not for ever faster


@pytest.mark.parametrize(("low", "at", "to"), [(0.0, 20.0, -30.0), (-180.0, -170.0, 170.0)])
def test_another_winding_is_taken_where_one_is_refused(sims: list[Sim], low: float, at: float, to: float) -> None:
    """The rotator takes no azimuth below `low`; the mount's stops allow one turn further on too."""
    wide = Mount((-400 * DEG, 400 * DEG), (0.0, 90 * DEG), 10 * DEG, 10 * DEG)
    sims.append(sim := Sim(azimuth=at, refuses=lambda n, az, el: -1 if az < low else 0))
    start = to if abs(to - at) < 180 else to - 360.0
    way = lambda t: (max(at - 2.0 * t, start), 30.0)  # noqa: E731
    r, off, told = drive(sim, way, 150.0, wide)
    assert off < BAND
    assert told[-1] == "rotator on"
    assert r.counts["windings"] == 1
    assert any("refuses" in t for t in told)


def test_saturation_at_its_own_stop_takes_the_other_winding_or_is_told(sims: list[Sim]) -> None:
    """It answers RPRT 0 and stays at 180°; the stops of the site allow -160° as well as 200°."""
    wide = Mount((-270 * DEG, 270 * DEG), (0.0, 90 * DEG), 10 * DEG, 10 * DEG)
    sims.append(sim := Sim(azimuth=150.0, stops=(-180.0, 180.0)))
    r, off, _ = drive(sim, still(200.0, 30.0), 90.0, wide)
    assert off < BAND
    assert r.counts["windings"] == 1
    narrow = Mount((0.0, 270 * DEG), (0.0, 90 * DEG), 10 * DEG, 10 * DEG)
    sims.append(sim := Sim(azimuth=150.0, stops=(-180.0, 180.0)))
    r, off, told = drive(sim, still(200.0, 30.0), 60.0, narrow)
    assert off > 10.0
    assert "off and comes no nearer: sent to 200.0 30.0, stands at 180.0 30.0" in told[-1]
    assert r.counts["resent"] > 3


@pytest.mark.parametrize("turn", [-360.0, 360.0, 720.0])
def test_a_rotator_at_another_winding_is_where_it_is(sims: list[Sim], turn: float) -> None:
    """It tells its azimuth a turn or two off: the same direction, and nothing to mend."""
    sims.append(sim := Sim(turn=turn))
    r, off, told = drive(sim, still(100.0, 45.0), 30.0)
    assert off < BAND
    assert told[-1] == f"rotator on, {turn / 360.0:+.0f} turn"
    assert r.counts["resent"] == 0


def test_one_that_counts_from_0_to_360(sims: list[Sim]) -> None:
    class Compass(Sim):
        def _answer(self, word: list[str]) -> bytes:
            return (
                f"{self.azimuth % 360.0:.2f}\n{self.elevation:.2f}\n".encode()
                if word[0] == "p"
                else super()._answer(word)
            )

    sims.append(sim := Compass(azimuth=-20.0))
    r, off, told = drive(sim, lambda t: (-20.0 + 2.0 * t, 40.0), 40.0)
    assert off < BAND + 2.5  # it moves on during a period
    assert "off" not in told[-1]
    assert r.counts["windings"] == 0


def test_a_hand_that_turns_it(sims: list[Sim]) -> None:
    sims.append(sim := Sim(hand=(20.0, 24.0, 160.0, 10.0)))
    r, off, told = drive(sim, still(60.0, 45.0), 60.0)
    assert off < BAND
    assert r.counts["resent"] >= 1
    assert any("stands at 160.0 10.0" in t for t in told)
    assert told[-1] == "rotator on"


def test_lost_replies_and_slow_answers(sims: list[Sim]) -> None:
    for kind, faults in {
        "every seventh lost": lambda n, a: [] if n % 7 == 0 else [a],
        "half of a position lost": lambda n, a: [a.split(b"\n")[0] + b"\n"] if n % 9 == 0 and b"R" not in a else [a],
        "byte by byte": lambda n, a: [a[i : i + 1] for i in range(len(a))],
    }.items():
        sims.append(sim := Sim(garbles=faults))
        r, off, told = drive(sim, still(60.0, 45.0), 90.0)
        assert off < BAND, kind
        assert told[-1] == "rotator on" or "away" in told[-1], kind
        assert (r.counts["lost"] > 0) == (kind != "byte by byte")
    sims.append(sim := Sim(delay=1.2))
    r, off, told = drive(sim, still(60.0, 45.0), 90.0)
    assert off < BAND
    assert r.counts["lost"] == 0
    sims.append(sim := Sim(delay=5.0))
    r, off, told = drive(sim, still(60.0, 45.0), 40.0)
    assert any("no answer to p within 3 s" in t for t in told)
    assert sim.commands == []


def test_garbage_an_endless_line_and_a_flood(sims: list[Sim]) -> None:
    sims.append(
        sim := Sim(garbles=lambda n, a: [b"hello\n", b"\xff\xfe\n", b"RPRT\n", b"RPRT x\n", b"12,5\n", b"\n", a])
    )
    r, off, told = drive(sim, still(60.0, 45.0), 30.0)
    assert off < BAND
    assert r.counts["garbage"] > 100
    sims.append(sim := Sim(garbles=lambda n, a: [b"x" * 3000] * 5 if n == 20 else [a]))
    r, off, told = drive(sim, still(60.0, 45.0), 40.0)
    assert off < BAND
    assert any("an endless line" in t for t in told)
    sims.append(sim := Sim(garbles=lambda n, a: [b"noise\n" * 500] * 3))
    r, _, told = drive(sim, still(60.0, 45.0), 20.0)
    assert sim.commands == []
    assert any("within 3 s" in t for t in told)  # noise is no answer


@pytest.mark.parametrize("numbers", ["nan\nnan\n", "inf\n20\n", "10\nnan\n", "1e9\n20\n", "-inf\n-inf\n"])
def test_a_position_that_is_none(sims: list[Sim], numbers: str) -> None:
    sims.append(sim := Sim(garbles=lambda n, a: [numbers.encode()] if n < 8 else [a]))
    _, off, told = drive(sim, still(60.0, 45.0), 40.0)
    assert off < BAND
    assert any("gives no position: its position is" in t for t in told)
    assert told[-1] == "rotator on"
    sims.append(sim := Sim(garbles=lambda n, a: [numbers.encode()] if b"R" not in a and n > 30 else [a]))
    _, off, told = drive(sim, still(60.0, 45.0), 40.0)
    assert "its position is" in told[-1]


def test_half_an_answer_does_not_outlive_its_connection(sims: list[Sim]) -> None:
    """Cut after each number of bytes of an answer in turn; the numbers are such that halves would be commands."""
    cut = {n: k for k, n in enumerate(range(3, 60, 3))}
    sims.append(
        sim := Sim(
            azimuth=80.0, elevation=7.0,
            garbles=lambda n, a: [a[: cut[n] % (len(a) + 1)], None] if n in cut else [a],  # type: ignore[list-item]
        )
    )  # fmt: skip
    r, off, _ = drive(sim, still(80.0, 10.0), 120.0)
    assert off < BAND
    assert r.counts["lost"] >= len(cut) - 1
    sent = np.array(sim.commands)
    assert (np.abs(sent[:, 0] - 80.0) < 0.01).all()  # today's bug: the next command was 7's partner
    assert ((sent[:, 1] >= 7.0) & (sent[:, 1] <= 10.0)).all()


def test_a_moving_target_with_everything_going_wrong(sims: list[Sim]) -> None:
    """200 s of a pass over the north, twenty seeds: within the limits always, near the target at the end."""
    for seed in range(20):
        rng = np.random.default_rng(seed)

        def garbles(n: int, a: bytes, rng: np.random.Generator = rng) -> list[bytes]:
            u = rng.random()
            if n > 300 or u > 0.12:
                return [a]
            kinds = ([], [a[:3]], [b"nan\n", a], [b"zz\n", a], [a, a], [a[: len(a) // 2], None], [b"RPRT -9\n"])
            return kinds[int(rng.integers(len(kinds)))]  # type: ignore[return-value]

        sim = Sim(
            azimuth=float(rng.uniform(-200, 200)), refuses=lambda n, az, el, rng=rng: -9 if rng.random() < 0.1 else 0,
            garbles=garbles, hand=(50.0, 53.0, float(rng.uniform(-200, 200)), 80.0),
            turn=float(rng.choice([0.0, 360.0])),
        )  # fmt: skip
        sims.append(sim)
        way = lambda t: (-60.0 + 0.8 * min(t, 150.0), 20.0 + 30.0 * math.sin(0.01 * min(t, 150.0)))  # noqa: E731
        _, off, told = drive(sim, way, 240.0)
        assert off < BAND or told[-1] != "rotator on", (seed, told[-3:])
        assert off < 5.0, (seed, told[-3:])


def test_no_answer_however_wrong_breaks_it(sims: list[Sim]) -> None:
    """5,000 answers of random bytes, and of answers with bytes changed, pieces lost and doubled."""
    rng = np.random.default_rng(77)

    def garbles(n: int, a: bytes) -> list[bytes]:
        kind = rng.integers(6)
        if kind == 0:
            return [rng.integers(0, 256, int(rng.integers(0, 60)), dtype=np.uint8).tobytes()]
        i, j = sorted(rng.integers(0, len(a) + 1, 2).tolist())
        if kind == 1:
            return [a[:i] + bytes([int(rng.integers(256))]) + a[i + 1 :]]
        return [a[:i] + a[j:]] if kind == 2 else [a[:i] + a[i:j] * 2 + a[j:]] if kind == 3 else [a]

    sims.append(sim := Sim(garbles=garbles))
    begin, r = 0.0, Rotator(f"127.0.0.1:{sim.port}", MOUNT, BAND * DEG, PERIOD)
    while sim.answers < 5000 and begin < 9e4:
        drive(sim, lambda t: (200.0 * math.sin(0.01 * t), 40.0 + 30.0 * math.cos(0.02 * t)), 200.0, MOUNT, begin, r)
        begin += 200.0
    r.close()
    assert sim.answers >= 5000
    assert r.counts["garbage"] > 100
    sim.garbles = lambda n, a: [a]
    _, off, told = drive(sim, still(60.0, 45.0), 100.0, MOUNT, begin)
    assert off < BAND
    assert told[-1] == "rotator on"


def test_rounding_does_not_leave_the_stops(sims: list[Sim]) -> None:
    odd = Mount((-100.00004 * DEG, 100.00004 * DEG), (5.00006 * DEG, 80.00004 * DEG), 20 * DEG, 20 * DEG)
    for to in ((170.0, 89.0), (-170.0, 0.0)):
        sims.append(sim := Sim())
        drive(sim, still(*to), 20.0, odd)
        az, el = sim.commands[-1]
        assert -100.00004 <= az <= 100.00004
        assert 5.00006 <= el <= 80.00004


def test_a_name_is_looked_up_once_and_not_at_every_send(sims: list[Sim], monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    real = socket.getaddrinfo

    def lookup(host: str, *args: object, **more: object) -> object:
        asked.append(host)
        if host == "rotator.invalid":
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return real("127.0.0.1", *args, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(socket, "getaddrinfo", lookup)
    sims.append(sim := Sim())
    r = Rotator(f"rotator.example:{sim.port}", MOUNT, BAND * DEG, PERIOD)
    drive(sim, still(60.0, 45.0), 20.0, rotator=r)
    assert r.told(20.0) == "rotator on"
    assert asked == ["rotator.example"]
    r.close()
    r = Rotator("rotator.invalid:1", MOUNT, BAND * DEG, PERIOD)
    for k in range(300):
        assert r.follow(1.0, 0.5, 0.1 * k) is None
    assert r.told(30.0) == "rotator away: rotator.invalid: Name or service not known"
    assert len(asked) <= 5
    with pytest.raises(UserError, match="host:port"):
        Rotator("nowhere", MOUNT, 0.1, 1.0)


def test_no_rotator_is_told(sims: list[Sim]) -> None:
    sims.append(sim := Sim())
    port = sim.port
    sim.close()
    r = Rotator(f"127.0.0.1:{port}", MOUNT, BAND * DEG, PERIOD)
    for k in range(50):
        assert r.follow(1.0, 0.5, 0.1 * k) is None
    assert r.told(5.0) == "rotator away: connection refused"
    assert r.summary(5.0)["rotator_told"] == "rotator away: connection refused"
    r.close()
