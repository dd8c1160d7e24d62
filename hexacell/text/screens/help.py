"""What each screen is for, and what its keys do."""

SCREEN_HELP = {
    "cell": """\
What is attached shows here as it is now, a card each: gauges with reading, place in their travel, noise \
and age, the encoders, the controller, the stop line. Below are the cell in a few lines and the robot. \
f shows the whole cell file; behind each value is its line, or "default" where the file does not state it.

A device that does not answer says why. Mend that before you go to 2 Preflight.""",
    "preflight": """\
Everything that must hold before the robot moves, one line each:
  ✓ it holds      ✗ it does not, with what to do
  … being looked at      · not looked at yet
Enter looks at all of it; nothing moves. v tries the plan on simulated robots and says how many records \
and minutes it takes and how accurate the robot will be. x shows its poses: x there excludes, in the \
cell file, what the robot must not be sent to. s starts a calibration, k a check that changes nothing, K \
the quick level, which corrects with fewer records what has drifted since the last result, r goes on \
with the latest run that was interrupted. In a cell with a fixture of known length, l checks the length \
scale, and L calibrates and checks it before the verdict. Everything is looked at again before the first \
move. i shows which devices answered.""",
    "measure": """\
The banner says what happens now, what is next, and how long it takes with the people who place gauges. \
Each gauge shows its deviation from the reference, and where its plunger stands in its travel. A record \
lands with what it is off: measured less predicted, or less what the fit says once there is one, the \
largest of x, y and z, and how many sigma that is. More than 4 sigma is marked and deserves a look; Enter \
measures the chosen record again.

The picture is the predicted error at the worst task pose; it falls record by record to the limit.""",
    "review": """\
The verdict first, with what it holds for and what was not checked. Then each parameter: old, new, \
change, its standard deviation sigma, and what that means. Before and after are compared at poses that \
took no part in the identification. Last is the exact change of the controller's config.

Press w to approve or decline. Approving is refused, with the reason, until the gates pass. Where the \
change is beyond the drawing's tolerance, the cell's name must be typed.""",
    "history": """\
All runs of this cell, the latest first. The arrows choose one.
  Enter  open it: 3 Measure and 4 Review show it as it was, with a cursor in time
  v      compare it with the one before it
  o      the drift of each parameter over all runs, with its sigma
  b      go back to the config that it wrote, or undo it if the controller has it
  w      write the proposal of a run that nobody has approved yet

Going back and writing ask first. They are refused where somebody has edited the file since; then all \
three versions are shown. A proposal is written under the gates of its run.""",
}

REPLAY_HELP = """\
A recorded run: space plays or halts it, right and left step by one event, page down and page up by a \
hundred, home and end go to its ends, + and - change the speed. Nothing moves."""

KEYS_TITLE = "Keys of all screens"

KEYS_NOTE = "Choose others in {path}, below [keys]. Everything is in the palette as well (ctrl+p)."
