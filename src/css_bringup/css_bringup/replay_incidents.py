# SPDX-License-Identifier: Apache-2.0
"""What was not as it should be in a replay, in one line each, as flights tell it."""

from css_bringup.replay_pass import Replay


def replay_incidents(stepping: Replay) -> list[str]:
    """What the estimators of a replay refused, missed or failed at; of refusals first how many, then why the first.

    Args:
        stepping: the replay, over.
    """
    lines = [
        f"{count} messages of {topic} refused ({kind})"
        for topic, kinds in stepping.rejected.items()
        for kind, count in kinds.items()
    ]
    lines += [
        f"{count} readings counted as missing ({topic} {kind})"
        for topic, kinds in stepping.missing.items()
        for kind, count in kinds.items()
    ]
    for run in stepping.runs:
        if run.failures:
            lines.append(f"{run.label}: {run.failures} cycles failed, or gave what is not finite and was withheld")
        if run.matcher.unmatched:
            lines.append(
                f"{run.label}: {run.matcher.unmatched} messages that no cycle used, because what belongs to them did "
                "not come"
            )
        lines += [f"{run.label}: {line}" for line in run.matcher.complaints()]
    return [*lines, *stepping.reports]
