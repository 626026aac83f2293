"""The report of an identification: tables, a verdict, and a self-contained HTML page."""

from sidegan.report.identification.content import Origin, check_table
from sidegan.report.identification.results import PARAMETERS, REPORT, VERDICT, write_checks, write_results

__all__ = ["PARAMETERS", "REPORT", "VERDICT", "Origin", "check_table", "write_checks", "write_results"]
