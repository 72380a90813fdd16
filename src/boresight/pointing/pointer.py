"""From reports to commands: the guide filter, the aim ahead of time, and what to do when sources fall silent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Any, NamedTuple, Protocol

import numpy as np

from boresight.errors import UserError
from boresight.frames.array_face import Pole, enu_from_face
from boresight.frames.azel import azel_from_enu
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.tangent import direction_from_tangent
from boresight.kernels.guide import EQUATOR, TRACK
from boresight.kernels.guide_run import ACCEPTED, C_BEST
from boresight.pointing.beam import Aim, aim_at
from boresight.pointing.guide import EYE, NONE, THINNED, GuideSource, Predicted
from boresight.pointing.mount import Mask, horizon_at
from boresight.types import Site
from boresight.types.sensor import FloatArray

NEAR = 20e3  # m: what is nearer is in sight, unless the mount's own horizon says otherwise


class Mode(StrEnum):
    """What the beam follows."""

    FUSED = "fused"  # guide sources (and own tracking where it is there)
    OWN = "own"  # own tracking alone: no guide is fresh
    COAST = "coast"  # nobody is fresh: the prediction goes on, its covariance grows
    SEARCH = "search"  # the covariance has outgrown the beam: a spiral about the prediction
    BELOW_HORIZON = "below_horizon"  # the target stands below the horizon: the beam waits where it is, nobody searches
    NO_ATTITUDE = "no_attitude"  # the platform's navigation is too old: face and mount angles are not known


class Choice(StrEnum):
    """Which sources may steer."""

    AUTO = "auto"
    GUIDE = "guide"  # guide sources only
    OWN = "own"  # own tracking only


class Pointing(NamedTuple):
    """One command."""

    t: float  # s
    t_aim: float  # s, when the beam will be there
    aim: Aim
    mode: Mode
    mount_azimuth: float  # rad, in the axes the mount stands on: the platform's, or the site's
    mount_elevation: float


class Guide(Protocol):
    """Where the target is: a `GuideFilter` of reports, or a track of the tracker (`follow.TrackGuide`)."""

    @property
    def sources(self) -> tuple[GuideSource, ...]:
        """Who reports."""
        ...

    @property
    def orbit(self) -> bool:
        """Whether the target flies on an orbit."""
        ...

    def init(self) -> Any:
        """Return the state before the first report."""
        ...

    def step(self, state: Any, source: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray) -> int:
        """Take in one report; returns its fate."""
        ...

    def surprise(self, state: Any, source: int, t: float, z: FloatArray, origin: FloatArray, axes: FloatArray) -> float:
        """Return how far a report lies from the prediction."""
        ...

    def predict(self, state: Any, t: float) -> Predicted | None:
        """Return the target at time `t` (s)."""
        ...

    def restart_now(self, state: Any) -> None:
        """Forget the target."""
        ...


@dataclass(frozen=True, slots=True)
class Pointer:
    """Configuration of the chain.

    `own` (s,) says which sources are own tracking. A source is fresh until `stale` (s) after its last report; going
    back from own tracking or coasting to the guides takes `settle` (s) of fresh reports: hysteresis. `search_below`
    is the probability in the beam below which the beam begins to search while nobody is fresh. `horizon`: corners
    (azimuth, elevation) (rad) in the axes the mount stands on.
    """

    guide: Guide
    site: Site
    own: tuple[bool, ...]
    face: tuple[float, float, float] = (0.0, 0.5 * math.pi, 0.0)  # boresight azimuth, elevation, skew (rad)
    pole: Pole = Pole.ON_NORMAL
    beam_width: float = math.radians(1.0)  # full
    lead: float = 1.0  # s: computation, link and mechanics
    choice: Choice = Choice.AUTO
    stale: float = 3.0
    settle: float = 2.0
    search_below: float = 0.5
    horizon: Mask = ()  # of what stands in the way; without it the Earth itself, from 0° on

    def __post_init__(self) -> None:
        if len(self.own) != len(self.guide.sources):
            raise UserError("pointer: say for each source whether it is own tracking")
        if not (self.beam_width > 0 and self.lead >= 0 and self.stale > 0):
            raise UserError("pointer: beam width and stale time must be above zero, the lead not negative")

    def init(self) -> PointerState:
        """Return the state before the first report."""
        n = len(self.own)
        never = np.full(n, -math.inf)
        return PointerState(self.guide.init(), never, never.copy(), np.full(n, math.inf), Mode.COAST, -math.inf, 0)

    def allowed(self, source: int) -> bool:
        """Return whether a source may steer by the choice made by hand."""
        return self.choice == Choice.AUTO or (self.choice == Choice.OWN) == self.own[source]

    def take(
        self,
        state: PointerState,
        source: int,
        t: float,
        z: FloatArray,
        origin: FloatArray = NONE,
        axes: FloatArray = EYE,
    ) -> int:
        """Take in one report in the state's own arrays; returns its fate (`kernels.guide_run`), -1 if not allowed.

        Of a direction any of azimuth, elevation and range may be NaN: not measured (see `GuideFilter.step`).
        """
        if not self.allowed(source):
            return -1
        fate = self.guide.step(state.guide, source, t, z, origin, axes)
        if fate in (ACCEPTED, THINNED):
            if self.guide.sources[source].kind == TRACK:
                state.spread[source] = math.sqrt(float(np.sum(axes[:3] ** 2)) / 3.0)
            if t - state.last[source] > self.stale:
                state.since[source] = t
            state.last[source] = max(state.last[source], t)
        return fate

    def tick(self, state: PointerState, t: float, place: Place | None = None) -> tuple[PointerState, Pointing | None]:
        """Return the command at time `t` (s); None before the first report with a range.

        A target without a direction, or one whose covariance has broken down, is forgotten (None): no report, however
        wrong, is to end the service.

        `place` is the antenna's at the time it aims for, if it moves; azimuth and elevation are in the site's ENU, the
        mount's in the platform's axes. With a place whose attitude is lost (NaN) the mode says so, and P(in beam), face
        and mount angles are NaN.
        """
        predicted = self.guide.predict(state.guide, t + self.lead)
        if predicted is None:
            return state, None
        R, here, face = _geometry(self.site, self.face)
        if place is not None:
            here = place.position
            face = face if math.isnan(place.enu_from_mount[0, 0]) else place.enu_from_face
        args = (face, self.pole, 0.5 * self.beam_width)
        to_target, velocity = (predicted.position - here) @ R, predicted.velocity @ R
        covariance = R.T @ predicted.covariance @ R
        try:
            aim = aim_at(to_target, velocity, covariance, *args)
        except UserError:
            self.guide.restart_now(state.guide)
            return state, None
        mode = Mode.BELOW_HORIZON if self._below(state, t, aim, place) else self._mode(state, t, aim)
        if mode == Mode.SEARCH:
            begun = state.search_begun if state.mode == Mode.SEARCH else t
            n = state.searched + 1 if state.mode == Mode.SEARCH else 0
            d = direction_from_tangent(aim.direction, _spiral(n, self.beam_width, 3.0 * aim.sigma))
            azimuth, elevation, _ = azel_from_enu(*(float(v) for v in d))
            aimed = aim_at(d * np.linalg.norm(to_target), velocity, covariance, *args)
            aim = aimed._replace(azimuth=azimuth, elevation=elevation, p_in_beam=aim.p_in_beam)
            state = state._replace(mode=mode, search_begun=begun, searched=n)
        else:
            state = state._replace(mode=mode, searched=0)
        if place is None:
            return state, Pointing(t, t + self.lead, aim, mode, aim.azimuth, aim.elevation)
        if math.isnan(place.enu_from_mount[0, 0]):
            no = math.nan
            blind = aim._replace(face_azimuth=no, face_elevation=no, cosine_right=no, cosine_up=no, p_in_beam=no)
            return state, Pointing(t, t + self.lead, blind, Mode.NO_ATTITUDE, math.nan, math.nan)
        on_board = (float(v) for v in unit_of(aim.azimuth, aim.elevation) @ place.enu_from_mount)
        azimuth, elevation, _ = azel_from_enu(*on_board)
        return state, Pointing(t, t + self.lead, aim, mode, azimuth, elevation)

    def path(self, state: PointerState, t: float, ahead: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return azimuth and elevation (n,) (rad) of the target, as commanded `ahead` (n,) (s) of `t` (s).

        None where there is none, or where it cannot be foretold: off an orbit, manoeuvres begin within seconds.
        """
        predicted = (
            [self.guide.predict(state.guide, t + self.lead + float(s)) for s in ahead] if self.guide.orbit else []
        )
        R, here, _ = _geometry(self.site, self.face)
        to = np.array([(p.position - here) @ R for p in predicted if p is not None])
        if not len(to) or not (np.linalg.norm(to, axis=1) > 0.0).all():
            return None
        azimuth, elevation, _ = azel_from_enu(to[:, 0], to[:, 1], to[:, 2])
        return np.asarray(azimuth), np.asarray(elevation)

    def ages(self, state: PointerState, t: float) -> FloatArray:
        """Return how old each source's last good report is (s), infinite before the first."""
        return t - state.last

    def weights(self, state: PointerState, out: Pointing) -> FloatArray:
        """Return each source's share (s,) in a command: of one report's information across the line of sight.

        By the learned variance of each source; none for one that is not fresh or is held to be biased.
        """
        sources = self.guide.sources
        angle = np.array([s.sigma_across * out.aim.distance for s in sources])
        sigma = np.where(angle > 0.0, angle, [s.sigma_position for s in sources])
        sigma = np.where(sigma > 0.0, sigma, state.spread)
        fresh = out.t - state.last <= self.stale
        biased = np.arange(1, len(sources) + 1) == int(state.guide.clock[C_BEST])
        says = fresh & ~biased & (sigma > 0.0)  # a range alone says nothing across the line of sight
        share = np.where(says, 1.0 / (state.guide.scale * np.where(says, sigma, 1.0) ** 2), 0.0)
        return share / max(float(share.sum()), 1e-300)

    def _below(self, state: PointerState, t: float, aim: Aim, place: Place | None) -> bool:
        """Return whether the target stands below the horizon; what own tracking sees does not."""
        if any(own and t - last <= self.stale for own, last in zip(self.own, state.last.tolist(), strict=True)):
            return False
        azimuth, elevation = aim.azimuth, aim.elevation
        if not self.horizon:  # what is nearer than the point where the line of sight meets the level stands before it
            meets = (EQUATOR + self.site.height) * math.sin(-elevation)
            return elevation < 0.0 and aim.distance > max(meets, NEAR)
        if place is not None and not math.isnan(place.enu_from_mount[0, 0]):
            on_board = (float(v) for v in unit_of(azimuth, elevation) @ place.enu_from_mount)
            azimuth, elevation, _ = azel_from_enu(*on_board)
        return elevation < float(horizon_at(self.horizon, azimuth))

    def _mode(self, state: PointerState, t: float, aim: Aim) -> Mode:
        fresh = [t - last <= self.stale for last in state.last.tolist()]
        guides = [i for i, own in enumerate(self.own) if fresh[i] and not own]
        tracking = any(f and own for f, own in zip(fresh, self.own, strict=True))
        if guides:
            settled = any(t - state.since[i] >= self.settle for i in guides)
            if settled or state.mode == Mode.FUSED or not tracking:
                return Mode.FUSED
        if tracking:
            return Mode.OWN
        return Mode.SEARCH if aim.p_in_beam < self.search_below else Mode.COAST


class Place(NamedTuple):
    """Where a moving antenna is and how its face is turned."""

    position: FloatArray  # (3,) ECEF m
    enu_from_face: FloatArray  # (3, 3)
    enu_from_mount: FloatArray  # (3, 3) columns right, forward, up of the platform; NaN where the attitude is lost


@lru_cache(maxsize=16)
def _geometry(site: Site, face: tuple[float, float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    here = np.array(ecef_from_enu(0.0, 0.0, 0.0, site))
    return ecef_from_enu_rotation(site), here, enu_from_face(*face)


class PointerState(NamedTuple):
    """All that changes.

    `last` and `since` (s,): last good report of each source, and since when it has been fresh; `spread` (s,): m per
    axis, of the last track of a source of tracks.
    """

    guide: Any  # of its `Guide`
    last: FloatArray
    since: FloatArray
    spread: FloatArray
    mode: Mode
    search_begun: float
    searched: int


def unit_of(azimuth: float, elevation: float) -> FloatArray:
    """Return the unit vector (3,) of an azimuth and elevation (rad)."""
    c = math.cos(elevation)
    return np.array([c * math.sin(azimuth), c * math.cos(azimuth), math.sin(elevation)])


def _spiral(n: int, width: float, reach: float) -> FloatArray:
    """Return the n-th offset (2,) (rad) of a spiral with arms 0.8 beam widths apart; it begins anew at `reach`."""
    pitch = 0.8 * width
    turns = max(math.pi * (max(reach, pitch) / pitch) ** 2, 1.0)  # points until the arm is out there
    angle = math.sqrt(4.0 * math.pi * (n % math.ceil(turns)))
    radius = pitch * angle / (2.0 * math.pi)
    return np.array([radius * math.cos(angle), radius * math.sin(angle)])
