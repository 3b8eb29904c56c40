#pragma once
#include <filesystem>
#include <functional>
#include <vector>

#include "Renderer.h"
#include "World.h"

namespace jacket::demo {

/// Pictures of a run: moments are kept while it runs, and drawn at its end, when the camera can be placed so that it
/// sees all of them.
class Pictures {
  public:
    Pictures(const World& start, int every);   ///< every so many frames; the start is frame 0
    void add(const World& world, int frame);   ///< keeps the frame if it is one to be drawn
    void keep(const World& world, int frame);  ///< keeps it in any case

    int count() const { return static_cast<int>(m_moments.size()); }
    /// The camera for all kept moments, with nothing before it.
    View stage(double aspect) const;
    View view(int index, View stage) const;
    /// Draws folder/000000.png ..., named by frame; `drawn(i)` is called after each. Stops early when it returns false.
    void write(const std::filesystem::path& folder, int width, int height, const std::function<bool(int)>& drawn) const;

    struct Moment {
        int frame;
        std::vector<Eigen::Matrix3Xf> shells;  ///< positions [m]
        std::vector<BodyState> bodies;
    };
    const std::vector<Moment>& moments() const { return m_moments; }
    const std::vector<Surface>& bodySurfaces() const { return m_bodySurfaces; }  ///< in the bodies' frames

  private:
    Eigen::Matrix3Xf whatToShow() const;
    Camera camera(const Eigen::Matrix3Xf& points, double aspect) const;

    CameraDescription m_camera;
    std::vector<BodyDescription> m_bodies;
    std::vector<Indices<3>> m_triangles;  ///< of each shell
    std::vector<Surface> m_bodySurfaces;
    int m_every;
    std::vector<Moment> m_moments;
};

}  // namespace jacket::demo
