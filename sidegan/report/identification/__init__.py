"""The report of an identification: tables, a verdict, and one HTML file that a lab can put in its wiki."""

from sidegan.report.identification.checks import show_checks, write_checks
from sidegan.report.identification.content import Origin
from sidegan.report.identification.results import PARAMETERS, REPORT, VERDICT, write_results

__all__ = ["PARAMETERS", "REPORT", "VERDICT", "Origin", "show_checks", "write_checks", "write_results"]
