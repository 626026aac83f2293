"""The report of an identification: tables, a verdict, and one HTML file that a lab can put in its wiki."""

from sidegan.report.identification.check import show_checks
from sidegan.report.identification.content import Origin
from sidegan.report.identification.data import Finding, Friction, Report, Signals
from sidegan.report.identification.page import write_report
from sidegan.report.identification.results import CHECK, REPORT, VERDICT, write_checks, write_results

__all__ = [
    "CHECK",
    "REPORT",
    "VERDICT",
    "Finding",
    "Friction",
    "Origin",
    "Report",
    "Signals",
    "show_checks",
    "write_checks",
    "write_report",
    "write_results",
]
