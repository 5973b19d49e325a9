const char *NAME_message(int fault)
{
    switch (fault) {
    case 0: return "no fault";
    case NAME_STEP_TOO_SMALL: return "the step size has become too small: a law has a pole, or the motion is too stiff";
    case NAME_TOO_MANY_EVENTS: return "parts change their mode again and again at one instant";
    case NAME_NO_CONSISTENT_MODES: return "no modes of the parts are consistent";
    case NAME_CONTRADICTORY_START: return "start values contradict each other: what others follow from must be given";
    case NAME_TOO_MANY_STEPS: return "more than most_steps steps: the motion is stiff, and wants an implicit method";
    default: return "unknown fault";
    }
}
