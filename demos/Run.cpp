#include "Run.h"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <optional>

#include "Clocks.h"
#include "GlbAnimation.h"
#include "Interrupt.h"
#include "Pictures.h"
#include "Profile.h"
#include "Progress.h"
#include "ViewPage.h"

namespace jacket::demo {

namespace {

struct Size {
    int width, height;
};

Size readSize(const std::string& text) {
    Size size{};
    char rest = 0;
    constexpr int kLeast = 16, kMost = 8192;
    const bool isRead = std::sscanf(text.c_str(), "%dx%d%c", &size.width, &size.height, &rest) == 2;
    if (!isRead || std::min(size.width, size.height) < kLeast || std::max(size.width, size.height) > kMost)
        throw InputError("--size must be WIDTHxHEIGHT in pixels, 16..8192 each, got " + text);
    return size;
}

/// Where files and pictures of a run go, if anywhere.
class Files {
  public:
    Files(const RunOutput& output, const World& start) {
        if (output.out.empty()) return;
        m_directory.emplace(output.out);
        m_recorder.emplace(m_directory->folder(), start);
        if (output.pictureEvery > 0) m_pictures.emplace(start, output.pictureEvery);
        if (output.html) m_page.emplace(start);
        if (output.glb) m_animation.emplace(start);
        m_size = readSize(output.size);
    }
    void add(const FrameRecord& frame, const World& world) {
        if (m_recorder) m_recorder->add(frame, world);
        if (m_pictures) m_pictures->add(world, frame.frame);
        if (m_page) m_page->add(world, frame.frame);
        if (m_animation) m_animation->add(world, frame.frame);
    }
    void finish(const Json& result, Progress::Style style) {
        if (!m_directory) return;
        m_recorder->finish(result);
        if (m_page) writeText(m_directory->folder() / "view.html", m_page->html());
        if (m_animation) writeAnimation(result);
        if (m_pictures) {
            Progress progress(std::cerr, style, "pictures", m_pictures->count());
            m_pictures->write(m_directory->folder() / "frames", m_size.width, m_size.height, [&](int drawn) {
                progress.update(drawn);
                return !isInterrupted();
            });
        }
        if (!isInterrupted()) m_directory->commit();
    }
    const std::string& animationSummary() const { return m_animationSummary; }  ///< what it keeps

  private:
    void writeAnimation(const Json& result) {
        const std::string glb = m_animation->glb();
        writeText(m_directory->folder() / "anim.glb", glb);
        m_animationSummary = std::to_string(m_animation->momentCount()) + " of " +
                             std::to_string(result["frames"].get<int>() + 1) + " frames, " +
                             std::to_string((glb.size() + 999) / 1000) + " kB";
    }

    std::optional<OutputDirectory> m_directory;
    std::optional<Recorder> m_recorder;
    std::optional<Pictures> m_pictures;
    std::optional<ViewPage> m_page;
    std::optional<GlbAnimation> m_animation;
    std::string m_animationSummary;
    Size m_size{};
};

using AfterFrame = std::function<void(int, const World&)>;

/// Steps to the end, or until there is no sense in going on.
Profile simulate(World& world, Result& result, Files& files, Progress::Style style, const AfterFrame& afterFrame) {
    const int frames = world.scene().frames();
    Progress progress(std::cerr, style, world.scene().name, frames, world.scene().dt);
    Profile profile;
    for (int frame = 1; frame <= frames && !isInterrupted(); ++frame) {
        const FrameReport report = world.step(isInterrupted);
        if (isInterrupted()) break;  // the frame is not whole
        const double start = wallSeconds();
        const FrameRecord record = measure(world, frame, report);
        result.add(record);
        files.add(record, world);
        if (afterFrame) afterFrame(frame, world);
        profile.add(report, world.scene().substeps, wallSeconds() - start);
        progress.update(frame);
        if (!record.isFinite) break;
    }
    return profile;
}

}  // namespace

double readDuration(const std::string& option, const std::string& text) {
    const auto seconds = parseFraction(text);
    if (!seconds || !(*seconds > 0))
        throw InputError(option + " [s] must be a number > 0 or a fraction such as 1/120, got " + text);
    return *seconds;
}

void requireThreads(int threads) {
    constexpr int kMost = 64;
    if (threads < 1 || threads > kMost)
        throw InputError("--threads must be 1.." + std::to_string(kMost) + ", got " + std::to_string(threads));
}

void addOutputOptions(CLI::App& command, RunOutput& output) {
    command.add_option("--png", output.pictureEvery, "EVERY: a picture every so many frames, in DIR/frames");
    command.add_option("--size", output.size, "WIDTHxHEIGHT of the pictures; 960x720 if not given");
    command.add_flag("--html", output.html, "DIR/view.html: the motion in a browser, to be turned by mouse");
    command.add_flag("--glb", output.glb, "DIR/anim.glb: the motion as glTF, for Blender and the like");
    command.add_flag("--profile", output.profile, "Where the time went: a table, and \"profile\" in result.json");
    command.add_option("--threads", output.threads, "Threads that share the solve of a large shell; 1 if not given");
    command.add_flag("--quiet", output.quiet, "No progress; with --out nothing at all");
}

void checkOutputOptions(const CLI::App& command, const RunOutput& output) {
    readSize(output.size);
    if (command.count("--png") && output.pictureEvery < 1)
        throw InputError("--png must be >= 1 (a picture every so many frames), got " +
                         std::to_string(output.pictureEvery));
    if (command.count("--png") && output.out.empty()) throw InputError("--png needs --out DIR to put the pictures in");
    if (command.count("--size") && !command.count("--png"))
        throw InputError("--size needs --png: it is the pictures' size");
    if (output.html && output.out.empty()) throw InputError("--html needs --out DIR to put view.html in");
    if (output.glb && output.out.empty()) throw InputError("--glb needs --out DIR to put anim.glb in");
    requireThreads(output.threads);
}

int runScene(const Scene& scene, const RunOutput& output, const AfterFrame& afterFrame) {
    if (output.profile && scene.isStatic)
        throw InputError("--profile: a scene of mode \"static\" takes no steps whose time could be split up");
    World world(scene, output.threads);
    Result result(world);
    Files files(output, world);
    catchInterrupts();

    const Progress::Style style = Progress::styleFor(output.quiet);
    const Profile profile = simulate(world, result, files, style, afterFrame);
    for (const std::string& warning : world.takeWarnings()) std::cerr << "jacket: note: " << warning << '\n';
    Json summary = result.json(world);
    if (output.profile) summary["profile"] = profile.json();
    files.finish(summary, style);
    if (isInterrupted()) return endInterrupted(!output.out.empty());
    const bool isSilent = !output.out.empty() && output.quiet;
    if (!isSilent) printSummary(std::cout, summary);
    if (!isSilent && output.profile) printProfile(std::cout, summary["profile"]);
    if (!isSilent && !output.out.empty()) std::cout << "  written to        " << output.out << '\n';
    if (!isSilent && output.glb) std::cout << "  anim.glb          " << files.animationSummary() << '\n';
    return result.exitCode();
}

}  // namespace jacket::demo
