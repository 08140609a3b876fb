"""Cross-checks between sensors on neighbouring segments: clock offsets, segment labels and sensor slip."""

from sagittal.core.agreement.agree import Agreement, check_agreement
from sagittal.core.agreement.params import AgreementParams

__all__ = ["Agreement", "AgreementParams", "check_agreement"]
