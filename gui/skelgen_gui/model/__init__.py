"""View models: what the window shows, in numbers and texts without Qt: scene, camera, graph, matrix, lanes, curves.

Texts of the view models pass through `translate`, so that the window can have Qt translate them.
"""

from collections.abc import Callable

# Returns the translation of a text in a context; as `QCoreApplication.translate` does
_Translator = Callable[[str, str], str]

_translators: list[_Translator] = []


def translate(context: str, text: str) -> str:
    """Return the translation of a text, or the text itself if nobody translates.

    Parameters
    ----------
    context : str
        Where the text is used; the same word may have another translation elsewhere.
    text : str
        English text.
    """
    return _translators[-1](context, text) if _translators else text


def translate_with(translator: _Translator) -> None:
    """Let a translator translate all texts from now on."""
    _translators[:] = [translator]
