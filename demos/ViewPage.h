#pragma once
#include <string>

#include "Pictures.h"

namespace jacket::demo {

/// The motion as one page for a browser, with nothing outside it: WebGL 2, to be turned, zoomed and played.
class ViewPage {
  public:
    /// Keeps every frame, or only every so many where the page would become larger than some tens of megabytes.
    explicit ViewPage(const World& start);
    void add(const World& world, int frame) { m_pictures.add(world, frame); }
    std::string html() const;

  private:
    std::string m_title;
    double m_dt;
    Pictures m_pictures;
};

}  // namespace jacket::demo
