"""What is found out about a result, and reported.

Light to import: the command line reads the fields of the class.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from meshfix_cli.errors import RequirementError, together
from meshfix_cli.mesh.elements import words
from meshfix_cli.quality.metrics import having, types_with

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.quality.obstacles import Obstacles
    from meshfix_cli.quality.requirement import Requirement
    from meshfix_cli.quality.summary import Summary
    from meshfix_cli.report.facts import Report

NEAR_CEILING = 0.9  # of it: from there on it is what limits the smallest angle or scaled Jacobian


@dataclass(frozen=True)
class Judge:
    """What is found out about a result.

    Attributes
    ----------
    metrics : tuple of str
        Keys of `metrics.METRICS`.
    requirements : tuple of Requirement
    threads : int
    brief : bool
        Only what tells whether the result is valid and meets the requirements.
    """

    metrics: tuple[str, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    threads: int = 1
    brief: bool = False

    def check(self, document: Document) -> None:
        """Refuse, as a RequirementError, to judge a mesh by what none of its elements has."""
        for one in self.requirements:
            if not having(one.name, document.mesh):
                have = together([words(key)[1] for key in types_with(one.name)])
                raise RequirementError(f"{document.name}: no element has the {one.name} required; only {have} have one")

    def report(
        self,
        command: str,
        document: Document,
        stages: Mapping[str, Mesh],
        notes: tuple[str, ...] = (),
        obstacles: Obstacles | None = None,
        reference: NDArray[np.float64] | None = None,
        **more: Any,
    ) -> Report:
        """Summarise the stages of a mesh, of which the last is the result.

        Raises
        ------
        RequirementError
            See `check`.
        """
        from meshfix_cli.quality.obstacles import find_obstacles
        from meshfix_cli.quality.summary import ceiling, slid, summarise
        from meshfix_cli.report.facts import Report

        result = list(stages.values())[-1]
        self.check(document)
        shown = list(stages)[-1:] if self.brief else list(stages)  # nobody sees the others
        most = None if self.brief else ceiling(result, self.threads)
        asked = (one.name for one in self.requirements if one.is_metric)
        metrics = tuple(dict.fromkeys((*self.metrics, *asked)))
        shapes = reference if result.surface is None else None
        summaries = {stage: summarise(stages[stage], metrics, self.threads, shapes) for stage in shown}
        if not (self.brief or command == "perturb"):
            start = next(iter(stages.values()))
            displaced = document.displaced is not None  # where the boundary is to be
            before = start if reference is None or displaced else start.with_vertices(reference)
            if result.quadratic is not None:  # whose boundary does not slide
                slides = {}
            elif result.surface is not None:
                slides = slid(before, result, self.threads) if command == "untangle" else {}
            elif result.freedom is None:
                slides = self._might_slide(document, result, summaries[shown[-1]], most)
            else:
                slides = {
                    **slid(before, result, self.threads),
                    "ceiling_without_sliding": ceiling(start.held, self.threads),
                }
            if displaced and "shape" in slides:
                slides["shape"]["displaced"] = True
            more["facts"] = {**(more.get("facts") or {}), **slides}
        if result.surface is not None and not self.brief:
            from meshfix_cli.quality.obstacles import crossings_of_surface
            from meshfix_cli.report.happened import crossings

            notes += crossings(crossings_of_surface(result, self.threads))
        return Report(
            name=document.name,
            command=command,
            meshes=dict(stages),
            points=partial(document.file_points, result),
            ids=document.ids,
            stages=summaries,
            ceiling=most,
            obstacles=find_obstacles(result, self.threads) if obstacles is None else obstacles,
            fixed=document.fixed,
            not_judged=document.not_judged,
            higher_order=document.higher_order,
            notes=(*document.notes, *notes),
            requirements=self.requirements,
            **more,
        )

    def _might_slide(self, document: Document, result: Mesh, summary: Summary, most: float | None) -> dict[str, Any]:
        """Return what might be gained where no vertex slides and a ceiling limits the mesh."""
        from meshfix_cli.quality.summary import ceiling

        valid = summary.inverted == 0
        if most is None or (valid and summary.smallest < NEAR_CEILING * most):
            return {}
        from meshfix_cli.meshfile.sliding import slid

        sliding = slid(replace(document, mesh=result), tangled=not valid).mesh
        after = ceiling(sliding, self.threads)
        if after is not None and not after > most:
            return {}
        return {"slide_flat": {"free_vertices": int(sliding.movable.sum()), "ceiling": after}}
