"""Hatchling calls this when it builds a wheel, editable or not: the dialect is generated and goes into it.

The modules are not committed; a source distribution carries the generator instead.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class DialectBuildHook(BuildHookInterface):
    """Generates anafi_mav/mav_enums.py and anafi_mav/mavlink/dialect.py before hatchling collects the wheel's files."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if self.target_name != "wheel":
            return
        path = Path(self.root) / "dialect" / "generate.py"
        spec = importlib.util.spec_from_file_location("anafi_mav_dialect_generate", path)
        assert spec is not None
        assert spec.loader is not None
        generator = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(generator)
        # They are in .gitignore, which hatchling obeys unless the files are declared as products of the build.
        build_data["artifacts"] += [path.relative_to(self.root).as_posix() for path in generator.generate()]
