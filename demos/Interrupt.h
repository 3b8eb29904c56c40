#pragma once

namespace jacket::demo {

/// From now on the first SIGINT or SIGTERM lets a job end by itself: it asks isInterrupted(). A second one ends the
/// program at once.
void catchInterrupts();
bool isInterrupted();
/// Says so on stderr. Returns the program's exit code.
int endInterrupted(bool hasFolder);  ///< whether the job was to write files: none is left

}  // namespace jacket::demo
