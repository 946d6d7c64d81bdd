"""The only table of MAV_CMD numbers, with the names that messages to the user use.

A constant has its name from common.xml or ardupilotmega.xml without MAV_CMD_ and NAV_; five fence commands and the
return have shorter names.
"""

from __future__ import annotations

WAYPOINT = 16
LOITER_UNLIM = 17
LOITER_TURNS = 18
LOITER_TIME = 19
RTL = 20  # NAV_RETURN_TO_LAUNCH
LAND = 21
TAKEOFF = 22
CONTINUE_AND_CHANGE_ALT = 30
LOITER_TO_ALT = 31
ARC_WAYPOINT = 36
ROI = 80
SPLINE_WAYPOINT = 82
ALTITUDE_WAIT = 83
VTOL_TAKEOFF = 84
VTOL_LAND = 85
GUIDED_ENABLE = 92
DELAY = 93
PAYLOAD_PLACE = 94
LAST = 95  # the end of the NAV commands

CONDITION_DELAY = 112
CONDITION_CHANGE_ALT = 113
CONDITION_DISTANCE = 114
CONDITION_YAW = 115

DO_JUMP = 177
DO_CHANGE_SPEED = 178
DO_SET_HOME = 179
DO_SET_PARAMETER = 180
DO_SET_RELAY = 181
DO_REPEAT_RELAY = 182
DO_SET_SERVO = 183
DO_REPEAT_SERVO = 184
DO_SET_ACTUATOR = 187
DO_RETURN_PATH_START = 188
DO_LAND_START = 189
DO_GO_AROUND = 191
DO_REPOSITION = 192
DO_PAUSE_CONTINUE = 193
DO_SET_REVERSE = 194
DO_SET_ROI_LOCATION = 195
DO_SET_ROI_WPNEXT_OFFSET = 196
DO_SET_ROI_NONE = 197
DO_CONTROL_VIDEO = 200
DO_SET_ROI = 201
DO_DIGICAM_CONFIGURE = 202
DO_DIGICAM_CONTROL = 203
DO_MOUNT_CONFIGURE = 204
DO_MOUNT_CONTROL = 205
DO_SET_CAM_TRIGG_DIST = 206
DO_FENCE_ENABLE = 207
DO_PARACHUTE = 208
DO_INVERTED_FLIGHT = 210
DO_GRIPPER = 211
DO_AUTOTUNE_ENABLE = 212
SET_YAW_SPEED = 213
DO_SET_CAM_TRIGG_INTERVAL = 214
DO_SET_RESUME_REPEAT_DIST = 215
DO_SPRAYER = 216
DO_SEND_SCRIPT_MESSAGE = 217
DO_AUX_FUNCTION = 218
DO_GUIDED_LIMITS = 222
DO_ENGINE_CONTROL = 223

OBLIQUE_SURVEY = 260
COMPONENT_ARM_DISARM = 400
SET_CAMERA_MODE = 530
SET_CAMERA_ZOOM = 531
SET_CAMERA_FOCUS = 532
SET_CAMERA_SOURCE = 534
JUMP_TAG = 600
DO_JUMP_TAG = 601
DO_GIMBAL_MANAGER_PITCHYAW = 1000
DO_GIMBAL_MANAGER_CONFIGURE = 1001
IMAGE_START_CAPTURE = 2000
IMAGE_STOP_CAPTURE = 2001
DO_TRIGGER_CONTROL = 2003
VIDEO_START_CAPTURE = 2500
VIDEO_STOP_CAPTURE = 2501
DO_VTOL_TRANSITION = 3000
CONDITION_GATE = 4501

FENCE_RETURN_POINT = 5000  # NAV_FENCE_RETURN_POINT
POLYGON_IN = 5001  # NAV_FENCE_POLYGON_VERTEX_INCLUSION
POLYGON_OUT = 5002  # NAV_FENCE_POLYGON_VERTEX_EXCLUSION
CIRCLE_IN = 5003  # NAV_FENCE_CIRCLE_INCLUSION
CIRCLE_OUT = 5004  # NAV_FENCE_CIRCLE_EXCLUSION
RALLY_POINT = 5100

USER_1 = 31010
USER_2 = 31011
USER_3 = 31012
USER_4 = 31013
USER_5 = 31014
DO_WINCH = 42600
SCRIPT_TIME = 42702
ATTITUDE_TIME = 42703

COMMAND_WORDS = {
    WAYPOINT: "waypoint",
    LOITER_UNLIM: "loiter",
    LOITER_TURNS: "loiter turns",
    LOITER_TIME: "loiter time",
    RTL: "return to launch",
    LAND: "land",
    TAKEOFF: "take-off",
    LOITER_TO_ALT: "loiter to altitude",
    ARC_WAYPOINT: "arc waypoint",
    SPLINE_WAYPOINT: "spline waypoint",
    ALTITUDE_WAIT: "altitude wait",
    PAYLOAD_PLACE: "payload place",
    VTOL_TAKEOFF: "VTOL take-off",
    VTOL_LAND: "VTOL land",
    GUIDED_ENABLE: "guided enable",
    DELAY: "delay",
    CONDITION_DELAY: "condition delay",
    CONDITION_CHANGE_ALT: "condition altitude",
    CONDITION_DISTANCE: "condition distance",
    CONDITION_YAW: "condition yaw",
    DO_JUMP: "jump",
    DO_CHANGE_SPEED: "change speed",
    DO_SET_HOME: "set home",
    DO_SET_RELAY: "relay",
    DO_SET_SERVO: "servo",
    DO_RETURN_PATH_START: "return path start",
    DO_LAND_START: "land start",
    DO_GO_AROUND: "go around",
    DO_PARACHUTE: "parachute",
    DO_AUX_FUNCTION: "auxiliary function",
    DO_ENGINE_CONTROL: "engine control",
    DO_SET_PARAMETER: "set parameter",
    DO_SET_ROI_LOCATION: "region of interest",
    DO_SET_ROI_NONE: "no region of interest",
    DO_SET_ROI: "region of interest",
    DO_SET_CAM_TRIGG_DIST: "camera trigger",
    DO_GRIPPER: "gripper",
    FENCE_RETURN_POINT: "fence return point",
    POLYGON_IN: "fence vertex, inclusion",
    POLYGON_OUT: "fence vertex, exclusion",
    CIRCLE_IN: "fence circle, inclusion",
    CIRCLE_OUT: "fence circle, exclusion",
    RALLY_POINT: "rally point",
}
"""Names of commands in messages to the user."""


def command_name(command: int) -> str:
    """Return a MAV_CMD in words."""
    return COMMAND_WORDS.get(command, f"command {command}")


def is_nav(command: int) -> bool:
    """Whether it is a NAV command, which the mission waits for; DO and CONDITION commands have larger numbers."""
    return command < LAST
