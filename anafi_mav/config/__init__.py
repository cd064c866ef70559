"""Configuration: a YAML file becomes a frozen, checked `Config`.

A file that is wrong becomes one `ConfigError` that names the key. `schema` holds the keys and their meaning, `load`
reads and checks. The gateway takes the result.
"""

from anafi_mav.config.load import from_mapping as from_mapping
from anafi_mav.config.load import from_text as from_text
from anafi_mav.config.load import load as load
from anafi_mav.config.load import remarks as remarks
from anafi_mav.config.schema import Config as Config
from anafi_mav.config.schema import DroneConfig as DroneConfig
from anafi_mav.config.schema import HttpConfig as HttpConfig
from anafi_mav.config.schema import MediaConfig as MediaConfig
from anafi_mav.config.schema import RecordingConfig as RecordingConfig
from anafi_mav.config.schema import SimConfig as SimConfig
from anafi_mav.config.schema import VideoConfig as VideoConfig
from anafi_mav.endpoint_options import EndpointConfig as EndpointConfig
