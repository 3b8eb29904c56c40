#pragma once
#include <memory>
#include <vector>

#include "World.h"

namespace jacket::demo {

/// The same scene with Bullet's own btSoftBody for its shell, to be compared with.
class SoftWorld {
  public:
    static constexpr int kIterations = 10;  ///< of btSoftBody's positions, a step

    explicit SoftWorld(const Scene& scene);  ///< throws as check() does
    ~SoftWorld();

    /// Throws InputError unless the scene is one that btSoftBody can show: one shell, of a grid, held by pins alone.
    static void check(const Scene& scene);

    FrameReport step();  ///< one frame; of the report only times are set
    Points positions() const;
    std::vector<BodyState> bodies() const;

  private:
    struct Impl;
    std::unique_ptr<Impl> m_impl;
};

}  // namespace jacket::demo
