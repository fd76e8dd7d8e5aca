// Octree nodes as vertex buffers of oriented discs: position, normal, radius and colour of each point side by side, as a renderer of
// surfels (splats with depth) takes them. Datasets have normals as the attributes NormalX, NormalY and NormalZ, and radii as one
// named radius, if the scans had them. Where it says "buffer", an engine makes a vertex buffer of a mesh with MeshTopology.Points.

using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;

namespace Pointmill.Examples
{
    /// <summary>A vertex: 32 bytes, as the attributes of the vertex buffer stand one behind the other.</summary>
    [StructLayout(LayoutKind.Sequential)]
    public struct Surfel
    {
        /// <summary>POSITION, relative to the middle of the node.</summary>
        public float X, Y, Z;
        /// <summary>NORMAL, in the axes of the dataset; 0, 0, 0 of a point without one: draw it facing the eye.</summary>
        public float NormalX, NormalY, NormalZ;
        /// <summary>TEXCOORD0: world units.</summary>
        public float Radius;
        /// <summary>COLOR.</summary>
        public byte Red, Green, Blue, Alpha;
    }

    /// <summary>The buffers of a node: at most 65,000 vertices each.</summary>
    public sealed class SurfelNode
    {
        public Vector3d Place;
        public List<Surfel[]> Buffers = new List<Surfel[]>();
        public int Count;
    }

    public sealed class SurfelBuffers : IDisposable
    {
        private readonly Dataset dataset;
        private readonly Points points = new Points();
        private readonly int[] normals = new int[3];
        private readonly int radius;

        /// <summary>False: all normals are 0, 0, 0.</summary>
        public bool HasNormals { get { return normals[0] >= 0 && normals[1] >= 0 && normals[2] >= 0; } }
        /// <summary>False: the radius of a point is half the distance of points of its node.</summary>
        public bool HasRadii { get { return radius >= 0; } }

        public SurfelBuffers(string path, Axes axes = Axes.YUpLeftHanded)
        {
            dataset = Dataset.Open(path, axes);
            if (dataset.Info.Kind >= Kind.Bintree) throw new ArgumentException("this is no octree", "path");
            for (int a = 0; a < 3; a++) normals[a] = Find("Normal" + "XYZ"[a]);
            radius = Find("radius");
        }

        /// <summary>What to show from there; a renderer keeps what it has loaded, as PointCloudSet does.</summary>
        public IEnumerable<uint> Visible(Camera camera, ulong budget)
        {
            Selection selection = new Selection { Budget = budget, Order = Order.Radius, Load = true };
            Draw[] list = null;
            int count = dataset.Select(ref camera, ref selection, ref list);
            for (int i = 0; i < count; i++) yield return list[i].Node;
        }

        public SurfelNode Load(uint id)
        {
            Node node = dataset.Node(id);
            SurfelNode loaded = new SurfelNode { Place = node.Center, Count = points.Decode(dataset, id) };
            for (int first = 0; first < loaded.Count; first += Points.MeshVertices)
            {
                int count = Math.Min(Points.MeshVertices, loaded.Count - first);
                loaded.Buffers.Add(Window(node, first, count));
            }
            return loaded;
        }

        private Surfel[] Window(Node node, int first, int count)
        {
            Surfel[] surfels = new Surfel[count];
            float[] positions = new float[3 * count];
            byte[] colours = dataset.Info.HasColours ? new byte[4 * count] : null;
            points.Positions(first, count, node.Center, positions);
            if (colours != null) points.Colours(first, count, colours);
            double[] radii = Values(radius, first, count);
            double[] nx = Values(normals[0], first, count), ny = Values(normals[1], first, count), nz = Values(normals[2], first, count);
            for (int i = 0; i < count; i++)
            {
                Surfel s = new Surfel { X = positions[3 * i], Y = positions[3 * i + 1], Z = positions[3 * i + 2] };
                if (HasNormals) Turn(ref s, nx[i], ny[i], nz[i]);
                s.Radius = (float)(radii == null ? node.Spacing / 2 : radii[i]);
                s.Red = s.Green = s.Blue = s.Alpha = 255;
                if (colours != null)
                {
                    s.Red = colours[4 * i];
                    s.Green = colours[4 * i + 1];
                    s.Blue = colours[4 * i + 2];
                }
                surfels[i] = s;
            }
            return surfels;
        }

        /// <summary>Attributes are in the axes of the file: a normal is turned as positions are, and gets the length 1.</summary>
        private void Turn(ref Surfel s, double x, double y, double z)
        {
            double length = Math.Sqrt(x * x + y * y + z * z);
            if (!(length > 0)) return;
            s.NormalX = (float)(x / length);
            s.NormalY = (float)((dataset.Axes == Axes.ZUp ? y : z) / length);
            s.NormalZ = (float)((dataset.Axes == Axes.ZUp ? z : dataset.Axes == Axes.YUp ? -y : y) / length);
        }

        private int Find(string name) { return Array.FindIndex(dataset.Attributes, attribute => attribute.Name == name); }

        private double[] Values(int attribute, int first, int count)
        {
            if (attribute < 0) return null;
            double[] values = new double[count * dataset.Attributes[attribute].Elements];
            points.Values(attribute, first, count, values);
            return values;
        }

        public void Dispose()
        {
            points.Dispose();
            dataset.Dispose();
        }
    }
}
