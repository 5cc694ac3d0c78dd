"""The error of an estimate by evo, m: RMSE of positions after rigid alignment. Both are TUM files.

read_evo.py ESTIMATE TRUTH
"""

import sys

from evo.core.metrics import APE, PoseRelation
from evo.core.sync import associate_trajectories
from evo.tools.file_interface import read_tum_trajectory_file

truth, estimate = associate_trajectories(
    read_tum_trajectory_file(sys.argv[2]), read_tum_trajectory_file(sys.argv[1]), max_diff=1e-6
)
estimate.align(truth)
error = APE(PoseRelation.translation_part)
error.process_data((truth, estimate))
print(len(estimate.timestamps), error.get_all_statistics()["rmse"])
