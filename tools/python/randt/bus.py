"""The live bus; needs PyPI's iceoryx2. What is here is what `randt layout --python` prints."""

from randt import _randt

exec(compile(_randt.bus_module(), "randt layout --python", "exec"))
