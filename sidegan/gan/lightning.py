"""Lightning, which comes with the extra ``paper``: all files of this room have it from here."""

from sidegan.base.extras import extra

with extra("paper"):
    import pytorch_lightning as pl

__all__ = ["pl"]
