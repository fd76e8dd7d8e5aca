// Program walk PATH AXES: every figure of a dataset, line by line, as walk.c of the C interface prints it.
// Program examples OCTREE BATCHES BLOCKS BINTREE, program surfels OCTREE AXES, program mistakes DATASET FOREIGN: prints what is checked.

using System;
using System.Collections.Generic;
using System.Globalization;
using System.Text;
using Pointmill;
using Pointmill.Examples;

internal static class Program
{
    private static string Number(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }

    private static string Number(ulong value) { return value.ToString(CultureInfo.InvariantCulture); }

    private static void Line(params object[] words)
    {
        StringBuilder line = new StringBuilder();
        foreach (object word in words)
        {
            if (line.Length > 0) line.Append(' ');
            line.Append(word is double ? Number((double)word) : Convert.ToString(word, CultureInfo.InvariantCulture));
        }
        Console.WriteLine(line);
    }

    private static double[] Corner(Vector3d v) { return new[] { v.X, v.Y, v.Z }; }

    private static void Add(List<object> line, Box box)
    {
        double[] min = Corner(box.Min), max = Corner(box.Max);
        for (int a = 0; a < 3; a++)
        {
            line.Add(min[a]);
            line.Add(max[a]);
        }
    }

    private static ulong SumBytes(byte[] bytes, int count)
    {
        ulong sum = 0;
        for (int i = 0; i < count; i++) sum += bytes[i] * (ulong)(i % 251 + 1);
        return sum;
    }

    private static void WriteInfo(Dataset dataset, Info info)
    {
        List<object> line = new List<object>
        {
            "info", (uint)info.Kind, info.Points, info.Nodes, info.Attributes, info.HasColours ? 1 : 0
        };
        Add(line, info.Bounds);
        Add(line, info.Tight);
        line.AddRange(new object[] { info.Spacing, info.Scale.X, info.Offset.X, info.NodeCapacity, info.Bits });
        Line(line.ToArray());
        Line("projection", "[" + dataset.Projection + "]");
        foreach (AttributeInfo attribute in dataset.Attributes)
        {
            line = new List<object>
            {
                "attribute", "[" + attribute.Name + "]", (uint)attribute.Type, attribute.Elements, attribute.Size
            };
            for (int e = 0; attribute.Min != null && e < attribute.Elements; e++)
            {
                line.Add(attribute.Min[e]);
                line.Add(attribute.Max[e]);
            }
            Line(line.ToArray());
        }
    }

    private static void WritePoints(Dataset dataset, Info info, Node node, Points points)
    {
        int count = points.Count;
        float[] positions = new float[3 * count];
        double[] world = new double[3 * count], sums = new double[6];
        points.Positions(0, count, node.Center, positions);
        points.World(0, count, world);
        for (int i = 0; i < 3 * count; i++)
        {
            sums[i % 3] += positions[i];
            sums[3 + i % 3] += world[i];
        }
        List<object> line = new List<object> { "points", node.Id, count };
        foreach (double sum in sums) line.Add(sum);
        if (info.HasColours)
        {
            byte[] colours = new byte[4 * count];
            points.Colours(0, count, colours);
            line.Add(SumBytes(colours, colours.Length));
        }
        Line(line.ToArray());
        for (int a = 0; a < dataset.Attributes.Length; a++)
        {
            byte[] raw = new byte[dataset.Attributes[a].Size * count];
            double[] values = new double[dataset.Attributes[a].Elements * count];
            double sum = 0;
            points.Attribute(a, 0, count, raw);
            points.Values(a, 0, count, values);
            foreach (double value in values) sum += value;
            Line("values", a, SumBytes(raw, raw.Length), sum);
        }
    }

    private static void WriteNodes(Dataset dataset, Info info)
    {
        uint[] children = new uint[8];
        using (Points points = new Points())
        {
            foreach (Node node in dataset.Nodes())
            {
                int count = dataset.Children(node.Id, children);
                List<object> line = new List<object>
                {
                    "node", node.Id, "[" + dataset.Name(node.Id) + "]", node.Parent, node.Level, (uint)node.Flags, node.Points
                };
                Add(line, node.Bounds);
                for (int i = 0; i < count; i++) line.Add(children[i]);
                Line(line.ToArray());
                if ((node.Flags & NodeFlags.Drawable) == 0) continue;
                points.Decode(dataset, node.Id);
                WritePoints(dataset, info, node, points);
            }
        }
    }

    private static int BatchBytes(Dataset dataset, uint slot, Section section, byte[] values)
    {
        try
        {
            return dataset.ReadBatchSection(slot, section, 0, values);
        }
        catch (PointmillException)
        {
            return 0;
        }
    }

    private static void WriteSections(Dataset dataset, Info info)
    {
        if (info.Kind != Kind.Batches) return;
        byte[] values = new byte[10240 * 8];
        foreach (Section section in Enum.GetValues(typeof(Section)))
        {
            List<object> line = new List<object> { "section", (uint)section };
            try
            {
                using (MappedSection mapped = dataset.MapSection(section))
                {
                    byte[] bytes = new byte[mapped.Bytes];
                    System.Runtime.InteropServices.Marshal.Copy(mapped.Pointer, bytes, 0, bytes.Length);
                    line.AddRange(new object[] { 0, bytes.Length, SumBytes(bytes, bytes.Length) });
                }
            }
            catch (PointmillException error)
            {
                line.Add((uint)error.Status);
            }
            int total = 0;
            for (uint slot = 0; slot < info.Nodes; slot++) total += BatchBytes(dataset, slot, section, values);
            line.Add(total);
            Line(line.ToArray());
        }
    }

    /// <summary>From the south of the tight box to its middle.</summary>
    private static Camera CameraOf(Info info, Axes axes)
    {
        double[] min = Corner(info.Tight.Min), max = Corner(info.Tight.Max), eye = new double[3];
        double size = 0;
        for (int a = 0; a < 3; a++)
        {
            eye[a] = (min[a] + max[a]) / 2;
            size = Math.Max(size, max[a] - min[a]);
        }
        Camera camera = new Camera { VerticalFov = 1.0, Width = 1600, Height = 900 };
        double south = axes == Axes.YUp ? 1 : -1;
        bool zUp = axes == Axes.ZUp;
        eye[zUp ? 1 : 2] += south * 1.5 * size;
        camera.Eye = new Vector3d(eye[0], eye[1], eye[2]);
        camera.Forward = zUp ? new Vector3d(0, 1, 0) : new Vector3d(0, 0, -south);
        camera.Up = zUp ? new Vector3d(0, 0, 1) : new Vector3d(0, 1, 0);
        return camera;
    }

    private static void WriteSelection(Dataset dataset, Info info)
    {
        Camera camera = CameraOf(info, dataset.Axes);
        Selection selection = new Selection
        {
            Budget = info.Points / 2, PointRadius = 0.05, Order = Order.RadiusAndAngle, Load = true
        };
        Draw[] list = new Draw[1]; // grows
        int count = dataset.Select(ref camera, ref selection, ref list);
        for (int i = 0; i < count; i++)
        {
            double dMin, dMax;
            dataset.Distances(list[i].Node, camera.Eye, out dMin, out dMax);
            Draw d = list[i];
            Line("draw", d.Node, d.Parent, (uint)d.Material, d.Bits, d.Points, dMin, dMax, d.Pixels);
        }
    }

    private static void WritePick(Dataset dataset)
    {
        double[] world = new double[3];
        int up = dataset.Axes == Axes.ZUp ? 2 : 1;
        using (Points points = new Points())
        {
            foreach (Node node in dataset.Nodes())
            {
                if ((node.Flags & NodeFlags.Drawable) == 0 || points.Decode(dataset, node.Id) == 0) continue;
                points.World(0, 1, world);
                world[up] += 1000;
                Vector3d down = up == 2 ? new Vector3d(0, 0, -2) : new Vector3d(0, -2, 0);
                Vector3d origin = new Vector3d(world[0], world[1], world[2]);
                Hit hit = dataset.Pick(new Ray { Origin = origin, Direction = down, Radius = 0.01 });
                Line("hit", hit.Found ? 1 : 0, hit.Node, hit.Point, hit.Position.X, hit.Position.Y, hit.Position.Z, hit.Distance,
                    hit.OffRay);
                return;
            }
        }
    }

    private static void Walk(string path, Axes axes)
    {
        using (Dataset dataset = Dataset.Open(path, axes))
        {
            dataset.LoadAll(100000);
            Info info = dataset.Info;
            WriteInfo(dataset, info);
            WriteNodes(dataset, info);
            WriteSections(dataset, info);
            WriteSelection(dataset, info);
            WritePick(dataset);
        }
    }

    private static Camera CameraOf(string path, Axes axes)
    {
        using (Dataset dataset = Dataset.Open(path, axes)) return CameraOf(dataset.Info, axes);
    }

    private static void ShowSet(string path)
    {
        Camera camera = CameraOf(path, Axes.YUpLeftHanded);
        using (PointCloudSet set = new PointCloudSet { MinNodePixels = 0, LoadsPerUpdate = 1 })
        {
            set.Add(path);
            set.Add(path);
            int updates = 0;
            List<LoadedNode> shown;
            do
            {
                shown = set.Update(camera);
                updates++;
            }
            while (set.Missing > 0);
            long points = 0, meshes = 0;
            foreach (LoadedNode node in shown)
            {
                points += node.Points;
                foreach (MeshData mesh in node.Meshes) meshes += mesh.Count;
            }
            Line("set", shown.Count, points, meshes, updates, set.PointsInMemory);
            set.Budget = 0;
            set.CachedPoints = 1;
            Line("set", set.Update(camera).Count, set.PointsInMemory);
        }
    }

    private static void ShowBatches(string path)
    {
        using (BatchBuffers buffers = new BatchBuffers(path))
        {
            ulong sum = 0;
            long words = 0;
            int[] buffer = new int[10240];
            foreach (Section section in new[] { Section.Hi10, Section.Colour })
                buffers.Upload(section, buffer, (values, count, first) =>
                {
                    words += count;
                    for (int i = 0; i < count; i++) sum += (uint)values[i];
                });
            int visible = buffers.Visible(CameraOf(path, Axes.ZUp), ulong.MaxValue).Count;
            // a point of level 1 with the weight 0.408 (index 1): half of the cells of level 0 to a quarter
            Line("clod", (double)Library.ClodWeight(1), Library.ClodLevels(0, 1, 1), Library.ClodLevels(300, 1, 1),
                Library.ClodLevels(1001, 1, 1), Library.ClodKeeps(1, Library.ClodWeight(1), 1, Library.ClodSpacing(100, 2, 0)) ? 1 : 0,
                Library.ClodKeeps(1, Library.ClodWeight(1), 1, Library.ClodSpacing(200, 2, 0)) ? 1 : 0);
            Line("kept", buffers.Levels(0, 1), buffers.Keeps(0, 0, 0, 1) ? 1 : 0, buffers.Keeps(0, 0, 1e9f, 1) ? 1 : 0);
            Line("batches", buffers.Batches, buffers.Points, buffers.Records().Length, words, sum, visible);
        }
    }

    private static void ShowMaterials(string path)
    {
        Camera camera = CameraOf(path, Axes.YUpLeftHanded);
        using (TwoMaterials tree = new TwoMaterials(path))
        {
            int leaves = tree.LoadAll();
            foreach (double radius in new[] { 0.001, 0.02 })
            {
                tree.PointRadius = radius;
                tree.Update(camera);
                long far = 0, near = 0;
                tree.Far.ForEach(leaf => far += leaf.Classes.Length);
                tree.Near.ForEach(leaf => near += leaf.Classes.Length);
                Line("materials", leaves, tree.Far.Count, far, tree.Near.Count, near);
            }
            Line("pick", tree.Pick(camera.Eye, camera.Forward, 1.0).Found ? 1 : 0);
        }
    }

    private static void ShowSurfels(string path, Axes axes)
    {
        using (SurfelBuffers surfels = new SurfelBuffers(path, axes))
        {
            foreach (uint id in surfels.Visible(CameraOf(path, axes), ulong.MaxValue))
            {
                SurfelNode node = surfels.Load(id);
                Line("surfels", node.Count, surfels.HasNormals ? 1 : 0, surfels.HasRadii ? 1 : 0, node.Buffers.Count);
                foreach (Surfel[] buffer in node.Buffers)
                {
                    Surfel s = buffer[buffer.Length - 1];
                    double x = node.Place.X + s.X, y = node.Place.Y + s.Y, z = node.Place.Z + s.Z;
                    Line("buffer", buffer.Length, Math.Round(x, 3), Math.Round(y, 3), Math.Round(z, 3), (double)s.NormalX,
                        (double)s.NormalY, (double)s.NormalZ, (double)s.Radius, s.Red, s.Green, s.Blue, s.Alpha,
                        System.Runtime.InteropServices.Marshal.SizeOf(typeof(Surfel)));
                }
            }
        }
    }

    private static void Fail(string what, Action action)
    {
        try
        {
            action();
            Line(what, "no error");
        }
        catch (PointmillException error)
        {
            Line(what, error.Status, error.Message.Length > 0 ? "" : "no message");
        }
        catch (ObjectDisposedException)
        {
            Line(what, "disposed");
        }
    }

    private static void Mistakes(string path, string foreign)
    {
        Fail("foreign", () => Dataset.Open(foreign));
        Fail("missing", () => Dataset.Open("there/is/nothing/ü"));
        Dataset dataset = Dataset.Open(path);
        Points points = new Points();
        Fail("node", () => dataset.Node(100000));
        Fail("decode", () => points.Decode(dataset, 100000));
        points.Decode(dataset, 0);
        Fail("small", () => points.Positions(0, 2, new Vector3d(), new float[5]));
        Fail("null", () => points.Positions(0, 2, new Vector3d(), null));
        Fail("window", () => points.Positions(points.Count, 1, new Vector3d(), new float[3]));
        Fail("section", () => dataset.MapSection(Section.Hi10));
        dataset.Dispose();
        dataset.Dispose();
        Fail("closed", () => dataset.Node(0));
        points.Positions(0, 1, new Vector3d(), new float[3]); // lives on
        points.Dispose();
        Fail("freed", () => points.Positions(0, 1, new Vector3d(), new float[3]));
        string message;
        Line("valid", Library.Validate(path, out message).Ok ? 1 : 0, "[" + message + "]", Library.Version);
    }

    private static int Main(string[] args)
    {
        switch (args[0])
        {
            case "walk":
                Walk(args[1], (Axes)uint.Parse(args[2], CultureInfo.InvariantCulture));
                return 0;
            case "examples":
                ShowSet(args[1]);
                ShowBatches(args[2]);
                ShowBatches(args[3]);
                ShowMaterials(args[4]);
                return 0;
            case "surfels":
                ShowSurfels(args[1], (Axes)uint.Parse(args[2], CultureInfo.InvariantCulture));
                return 0;
            default:
                Mistakes(args[1], args[2]);
                return 0;
        }
    }
}
