"""How a topic is offered, as rosbag2 writes it into a bag: a late listener must get what was sent once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

__all__ = ["LATCHED", "QOS", "profiles_text"]

QOS = "offered_qos_profiles"
"""Key in the metadata of a channel."""

NEVER = {"sec": 2147483647, "nsec": 4294967295}
"""A time that does not come, as DDS has it."""


def profiles_text(profiles: Iterable[Any]) -> str:
    """Write the profiles of rosbags as rosbag2 has them since version 4: YAML, choices as numbers."""
    import yaml

    return str(yaml.safe_dump([_plain(profile) for profile in profiles], sort_keys=False)).strip()


def _plain(value: Any) -> Any:
    """Named tuples as mappings, choices as their numbers."""
    if hasattr(value, "_asdict"):
        return {name: _plain(each) for name, each in value._asdict().items()}
    return getattr(value, "value", value)


LATCHED = f"""- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {NEVER}
  lifespan: {NEVER}
  liveliness: 1
  liveliness_lease_duration: {NEVER}
  avoid_ros_namespace_conventions: false"""
"""Keep the last message, reliably, for those who come late: what ROS 1 calls latched."""
