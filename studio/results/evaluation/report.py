"""An evaluation as text and as one JSON object."""

from dataclasses import asdict

from studio.results.evaluation.errors import UNALIGNED, Evaluation


def as_document(evaluation: Evaluation) -> dict[str, object]:
    """The evaluation as plain JSON values, the threshold of a lost limb beside it."""
    return {**asdict(evaluation)}


def _constant_part(evaluation: Evaluation) -> list[str]:
    """Lines on the error without each marker's constant offset; none where that was not measured or for one frame."""
    if evaluation.without_offsets_mm is None or len(evaluation.frames) < 2:
        return []
    left, common = evaluation.without_offsets_mm, evaluation.common_offset_mm
    return [
        f"without each marker's constant offset  {left:.1f} mm (all are shifted by {common:.1f} mm in common)"
    ]


def _parts(evaluation: Evaluation) -> list[str]:
    """A line on whose fault the error is; none where no frame was searched for long."""
    if not evaluation.parts_mm:
        return []
    listed = ", ".join(f"{name} {mm:.1f}" for name, mm in evaluation.parts_mm.items())
    return [f"whose fault it is    {listed} mm of what the search found in {evaluation.parts_frames} frames"]


def in_words(evaluation: Evaluation) -> str:
    """The evaluation as text: every number with its alignment and threshold."""
    procrustes, threshold = evaluation.procrustes_mm, evaluation.lost_threshold_mm
    aligned = evaluation.alignment != UNALIGNED
    mean = "mean, so aligned  " if aligned else "mean, no alignment"
    lines = [
        f"frames measured      {len(evaluation.frames)}",
        *([f"truth laid on the run  {evaluation.alignment}"] if aligned else []),
        f"{mean}   {evaluation.mean_mm:.1f} mm (± {evaluation.std_mm:.1f} over frames)",
        f"worst frame          {evaluation.worst_mm:.1f} mm",
        f"root aligned         {evaluation.root_aligned_mm:.1f} mm",
        f"after Procrustes     {'-' if procrustes is None else f'{procrustes:.1f} mm'}",
        *_constant_part(evaluation),
        *_parts(evaluation),
        f"frames with a limb lost (a marker off by more than {threshold:.0f} mm)  {evaluation.lost_frames}",
    ]
    if evaluation.lost_limbs:
        lines.append(f"limbs lost           {', '.join(evaluation.lost_limbs)}")
    lines += [f"  {name:16} {value:7.1f} mm" for name, value in evaluation.per_marker_mm.items()]
    if evaluation.mean_direction_deg is not None:
        lines.append(f"limbs' directions     {evaluation.mean_direction_deg:.1f}° off in the mean")
    if evaluation.mean_angle_deg is not None:
        lines.append(f"angles between limbs  {evaluation.mean_angle_deg:.1f}° off in the mean")
        lines += [f"  {name:24} {value:5.1f}°" for name, value in evaluation.angles_deg.items()]
    if evaluation.unmatched_markers:
        lines.append(f"not matched          {', '.join(evaluation.unmatched_markers)}")
    return "\n".join(lines)
