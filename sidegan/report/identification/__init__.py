"""The report of an identification: one HTML file that a lab can put in its wiki."""

from sidegan.report.identification.data import Finding, Friction, Report, Signals
from sidegan.report.identification.write import write_report

__all__ = ["Finding", "Friction", "Report", "Signals", "write_report"]
