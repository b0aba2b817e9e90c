"""What keeping a cloth apart took, and what was left out of it because the scene did not need it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

from vto_pipeline.cloth.collision.body.contacts import BodyCollider
from vto_pipeline.model.job import Job


@dataclass
class CollisionCounters:
    """What was done and what was not.

    Args:
        asked: How often something had to be known of a step.
        out_of_reach: Of those, how often the cloth could be shown to stay out of its own reach.
        reused: Of those, how often an earlier search still held.
        searched: Of those, how often candidates were searched for.
        rested: Of those reused, how often it was of an earlier step: nothing had left the room it looked in.
        candidates: Most that a search has found.
        proof_s, search_s: Time taken by proofs and searches [s].
        body_asked, body_searched: How often candidates between cloth and bodies were asked and searched for.
        body_s: Time taken by those searches [s].
        impacts: Times of impact looked for.
        impacts_known: Pairs whose ways were just found free, and were not looked at again.
        impact_s: Time taken by looking [s].
        shortened: Vertices that could not go their whole way, over all steps.
        uncut: Pairs of the cloth and a moving body that meet, however short the cloth's move is cut.
    """

    asked: int = 0
    out_of_reach: int = 0
    reused: int = 0
    searched: int = 0
    rested: int = 0
    candidates: int = 0
    proof_s: float = 0.0
    search_s: float = 0.0
    body_asked: int = 0
    body_searched: int = 0
    body_s: float = 0.0
    impacts: int = 0
    impacts_known: int = 0
    impact_s: float = 0.0
    shortened: int = 0
    uncut: int = 0

    @property
    def saved_s(self) -> float:
        """Time that the searches left out would have taken, by those that were done [s]; 0 where there was none."""
        return self.search_s / max(self.searched, 1) * (self.out_of_reach + self.reused)

    @property
    def body_saved_s(self) -> float:
        """Likewise of the searches between cloth and bodies [s]."""
        return self.body_s / max(self.body_searched, 1) * (self.body_asked - self.body_searched)

    @property
    def impacts_saved_s(self) -> float:
        """Likewise of the times of impact [s]."""
        return self.impact_s / max(self.impacts, 1) * self.impacts_known

    def as_report(self) -> dict[str, float]:
        """Return all of it by name."""
        saved = ("saved_s", "body_saved_s", "impacts_saved_s")
        return {**asdict(self), **{name: getattr(self, name) for name in saved}}


def report_counters(counters: Sequence[CollisionCounters], bodies: Sequence[BodyCollider], job: Job) -> None:
    """Record, for `run.json`, what was left out, how often, and the time that saved."""
    whole = CollisionCounters(
        **{one.name: sum(getattr(one_cloth, one.name) for one_cloth in counters) for one in fields(CollisionCounters)}
    )
    needless = whole.out_of_reach + whole.reused
    if needless > 0:
        job.leave_out(
            "self-collision search",
            f"{needless / whole.asked:.0%} of {whole.asked} queries needed none. The cloth could not reach itself "
            f"({whole.out_of_reach}), or an earlier search still held ({whole.reused}, "
            f"{whole.rested} of them from an earlier step)",
        )
    if whole.asked > 0:
        job.measure(
            self_searches=whole.searched,
            self_searches_left_out=needless,
            self_searches_took_s=whole.proof_s + whole.search_s,
            self_searches_saved_s=whole.saved_s,
        )
    if whole.body_asked > 0:
        job.measure(
            body_searches=whole.body_searched,
            body_searches_left_out=whole.body_asked - whole.body_searched,
            body_searches_took_s=whole.body_s,
            body_searches_saved_s=whole.body_saved_s,
        )
    if whole.impacts + whole.impacts_known > 0:
        job.measure(
            impacts=whole.impacts,
            impacts_left_out=whole.impacts_known,
            impacts_took_s=whole.impact_s,
            impacts_saved_s=whole.impacts_saved_s,
        )
    if bodies:
        job.measure(
            body_refits_left_out=sum(one.refits_left_out for one in bodies),
            body_refits_saved_s=sum(one.refits_saved_s for one in bodies),
        )
