"""Motion in time: schemes, inertia, damping, and the states of a motion."""

from truespring.motion.follow import follow_motion as follow_motion
