"""How a fault is logged: with its code, so that it can be counted, limited and looked for."""

from __future__ import annotations

import logging

from fasaco_edge.errors import FasacoError


def log_fault(log: logging.Logger, fault: FasacoError) -> str:
    """Log a fault; return its text."""
    text = fault_text(fault)
    log.warning("%s", text, extra={"event": "fault", "code": fault.code})
    return text


def fault_text(fault: FasacoError) -> str:
    """Return a fault with what to do."""
    return f"{fault}: {fault.hint}" if fault.hint else str(fault)
