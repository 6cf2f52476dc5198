"""The errors of a live session without a page: springs that are pulled, beside finite elements in another process."""

import time

import truespring as ts
from truespring.live.measured import Measures
from truespring.live.ring import Kept, Ring
from truespring.live.twin import Twin

BEAM = ts.Problem(
    ts.box((0.04, 0.01, 0.01), (4, 1, 1)),
    ts.Material(young=3000.0, poisson=0.4, density=1000.0),
    supports=ts.Fixed(on="left"),
    loads=ts.Gravity((0, 0, -9.81)),
)


def errors(frames: int = 600) -> str:
    """Pull the end of a beam to the side, hold it there, and return the errors in words."""
    with ts.Live(BEAM, ts.Springs(rule="gaussian")) as live, Twin(live, ts.Fem(law="neo-hookean")) as twin:
        measures, ring = Measures(live), Ring(live.settings.frame)
        for frame in range(frames):
            if frame < 30:
                live.pull((0.04, 0.01, 0.01), to=(0.04, 0.01 + 1e-4 * frame, 0.01))
            live.step()
            ring.add(Kept(live.log.frames, live.time, live.positions))
            twin.follow()
            for ghost in twin.news():
                measures.take(ghost, ring)
            time.sleep(live.settings.frame)  # in real time
        return "\n".join(f"{name}: {words}" for name, words in measures.words().items())


if __name__ == "__main__":  # processes are started afresh
    print(errors())
