"""The pipeline and its bridge: `ros2 launch randt_ros2 randt.launch.py radar_topic:=/radar/points`.

Programs are taken from the PATH. Both are started again where they end.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

# Name, value if not given, and what it is.
ARGUMENTS = [
    ("radar_topic", "", "radar: PointCloud2, Image, LaserScan or Navtech's messages"),
    ("imu_topic", "", "IMU: sensor_msgs/Imu"),
    ("twist_topic", "", "wheels: Odometry, TwistStamped or TwistWithCovarianceStamped"),
    ("namespace", "", "namespace of all topics of the bridge"),
    ("robot", "robot.toml", "mounting and addresses of the sensors"),
    ("out", "randt", "folder of the results"),
    ("pipeline", "true", "whether the pipeline is started too, or runs already"),
]


def processes(context):
    """The programs, with the options that were given."""
    value = {name: LaunchConfiguration(name).perform(context) for name, _, _ in ARGUMENTS}
    bridge = ["randt-ros2", "--robot", value["robot"]]
    for option, name in [
        ("--radar-topic", "radar_topic"),
        ("--imu-topic", "imu_topic"),
        ("--twist-topic", "twist_topic"),
        ("--namespace", "namespace"),
    ]:
        if value[name]:
            bridge += [option, value[name]]
    started = [ExecuteProcess(cmd=bridge, output="screen", respawn=True)]
    if value["pipeline"] == "true":
        pipeline = ["randt", "up", "--no-drivers", "--robot", value["robot"], "--out", value["out"]]
        started.append(ExecuteProcess(cmd=pipeline, output="screen"))
    return started


def generate_launch_description():
    """What `ros2 launch` asks for."""
    arguments = [
        DeclareLaunchArgument(name, default_value=usual, description=what) for name, usual, what in ARGUMENTS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=processes)])
