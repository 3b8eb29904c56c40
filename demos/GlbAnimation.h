#pragma once
#include <string>
#include <vector>

#include "Pictures.h"

namespace jacket::demo {

/// The motion as one binary glTF 2.0 file, for Blender and other programs that show or edit such scenes: every shell a
/// mesh with a morph target per kept moment, every body a node that moves.
class GlbAnimation {
  public:
    /// Keeps about 30 moments of a simulated second, or fewer where the file would become larger than some tens of
    /// megabytes or have more morph targets than viewers are sure to take; always the start and the end.
    explicit GlbAnimation(const World& start);
    void add(const World& world, int frame);

    std::string glb() const;  ///< the file's bytes
    int momentCount() const { return m_pictures.count(); }

  private:
    std::string m_title;
    std::vector<std::string> m_shellNames, m_bodyNames;
    double m_dt;
    int m_frames;
    Pictures m_pictures;
};

}  // namespace jacket::demo
