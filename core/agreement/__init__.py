"""What sensors on neighbouring segments say about each other: clocks, labels, and whether one slipped."""

from sagittal.core.agreement.agree import Agreement, check_agreement
from sagittal.core.agreement.params import AgreementParams

__all__ = ["Agreement", "AgreementParams", "check_agreement"]
